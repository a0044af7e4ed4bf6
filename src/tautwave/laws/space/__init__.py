"""Walls in space: surfaces and their proxies, forces, and the energy that they may give."""
