"""The offline room: the same laws and models, compiled, for sweeps and benchmarks."""

from tautwave.offline.simulation import Simulation, simulate

__all__ = ["Simulation", "simulate"]
