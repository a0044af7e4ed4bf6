"""Verdicts on what acts on an axis beside its coupling: loads, friction, inertia, brakes."""
