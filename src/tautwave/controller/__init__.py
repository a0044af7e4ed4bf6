"""The controller, once: every axis, every pair, engaging, guarding and stopping.

State is records of numbers, constants are NamedTuples, steps are functions in the subset that plain
Python and numba share (see `laws`). The live loop calls them on slotted objects, compiled code the
same functions on NumPy records: `numpy_type` in `simulation` derives the layout from the same
annotations. Tables hold what is longer than a number: commands on their way and delay lines, each
beginning at an index that the constants name.
"""
