"""Readers of recordings, a module for each kind of file; `recordings.columns` has their table."""
