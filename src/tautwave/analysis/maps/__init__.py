"""Planes of parameters: where a wall is passive, stable or unstable."""
