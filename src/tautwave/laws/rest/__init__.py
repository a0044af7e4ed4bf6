"""Laws of axes that no coupling holds: a way to a place, a brake."""
