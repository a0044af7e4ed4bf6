"""Exact algebra: polynomials, rational functions, bounds that are proved rather than sampled."""
