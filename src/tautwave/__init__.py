"""Teleoperation over fieldbuses: a master and a slave device coupled by a taut string."""

__version__ = "0.1.0"
