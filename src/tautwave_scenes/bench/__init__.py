"""Measurements of scenes: error against run time, and stability at extremes."""
