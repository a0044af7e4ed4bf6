"""Tuning of a run while it goes on: the shared page for values, and the knobs they turn."""
