"""Frames on a CAN bus, and the canopen library on top of them, without a thread."""
