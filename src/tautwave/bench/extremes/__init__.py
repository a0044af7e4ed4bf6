"""Stiff and extreme cases: what holds, and what is refused with a reason."""
