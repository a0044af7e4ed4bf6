"""Strangers at a port: how many of the right dials get in while they are there."""
