"""`tautwave trials`: a user study, trial by trial, and its table."""
