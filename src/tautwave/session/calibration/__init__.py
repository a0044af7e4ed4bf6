"""`tautwave calibrate`: zero, direction and range of a rig's devices, and what they are."""
