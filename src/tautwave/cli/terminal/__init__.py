"""Terminal output: tables, progress, the summary of a run."""
