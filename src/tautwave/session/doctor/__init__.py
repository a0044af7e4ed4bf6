"""`tautwave doctor`: what of this machine costs a run time, and the command that mends it."""
