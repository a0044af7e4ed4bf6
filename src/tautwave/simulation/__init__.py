"""Simulation: the same laws and models on the fake clock, compiled or in plain Python."""

from tautwave.simulation.rows import Simulation
from tautwave.simulation.run import simulate

__all__ = ["Simulation", "simulate"]
