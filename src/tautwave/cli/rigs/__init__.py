"""Commands around a rig: before the first run, and after the last."""
