"""The keys of a rig file, as pydantic models: one file per block."""
