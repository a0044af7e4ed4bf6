"""Linear analysis of what the laws do on a sampled device: NumPy, offline only."""
