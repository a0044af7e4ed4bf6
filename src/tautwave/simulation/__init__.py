"""Simulation: the same laws and models on the fake clock, compiled or in plain Python."""

from tautwave.simulation.rows import Simulation
from tautwave.simulation.run import simulate, simulate_pieces

__all__ = ["Simulation", "simulate", "simulate_pieces"]
