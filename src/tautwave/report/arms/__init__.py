"""Arms of a run, drawn from their chains."""
