"""The allowance of each axis, filled from a rig's keys, once per rig."""
