"""Recordings that are read back: our own (MCAP), and columns of anybody's CSV or MAT files."""

RUN = "recording.mcap"
"""Name of the recording in the directory of a run."""

KINDS = (".csv", ".mcap", ".mat")
"""Suffixes of recordings; a run's directory stands for the recording in it."""
