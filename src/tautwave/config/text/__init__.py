"""The text of a rig file: YAML 1.2 with lines, `--set` laid over it, and written out again."""
