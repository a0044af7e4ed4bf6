"""Verdicts on ports of devices that take velocities or positions."""
