"""What simulations ask of the package behind `scene`."""

from __future__ import annotations

from typing import Protocol

from tautwave import registry
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.simulation.rows import Simulation


class SimulationHooks(Protocol):
    """Simulation of a rig with a scene."""

    def simulate(self, rig: Rig, duration_s: float | None, engine: str) -> Simulation:
        """Return the rows of a run, as `tautwave.simulate` does."""

    def is_compiled(self, rig: Rig) -> bool:
        """Return whether what a compiled simulation runs is in the cache."""


def simulation_hooks() -> SimulationHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: SimulationHooks = registry.control_hooks(SCENE, "simulation")
    return hooks
