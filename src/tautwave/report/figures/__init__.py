"""Figures of runs, sweeps and identifications, in one style."""
