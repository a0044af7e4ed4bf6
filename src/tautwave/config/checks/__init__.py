"""Cross-checks between the keys of a rig file."""
