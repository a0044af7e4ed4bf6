"""Observed ports: their noise, the devices on which they are contracting, their linear end."""
