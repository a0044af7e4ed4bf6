"""Packets, control tables, models and units of Dynamixel servos; no I/O."""
