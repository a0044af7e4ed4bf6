"""Axes while no coupling holds them: free, held, or pulled into place."""
