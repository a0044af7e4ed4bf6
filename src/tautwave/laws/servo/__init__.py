"""Laws of devices that take velocities or positions."""
