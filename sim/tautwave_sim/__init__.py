"""Simulated devices: the other end of every driver, and the loopback that needs no bus."""
