"""Couplings to compare with, as parts that a rig names by their file."""
