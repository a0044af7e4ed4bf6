"""What a person sees in the terminal: tables, progress, the end of a run."""
