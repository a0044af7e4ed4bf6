"""Procedures that a person is led through while the loop runs, and that are recorded."""
