"""Changing numbers of a run while it goes on: the desk they come over, and the knobs they turn."""
