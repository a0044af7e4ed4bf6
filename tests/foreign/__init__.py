"""Devices written apart from our simulators and drivers, from the standards alone."""
