"""Stiff and extreme cases: what works, and what is refused with a reason."""
