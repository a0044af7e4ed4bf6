"""What `bench workprecision` and `bench extremes` ask of the package behind `scene`."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from tautwave import registry
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.simulation.rows import Simulation

if TYPE_CHECKING:
    from tautwave.bench.precision.points import Scene
    from tautwave.bench.result import Group


class BenchHooks(Protocol):
    """Measurements of a rig with a scene."""

    def precision(
        self,
        rig: Rig,
        path: Path,
        changes: tuple[str, ...],
        full: bool,
        begin_s: float,
        max_error: float,
    ) -> Scene:
        """Return its schemes at steps over decades, from `begin_s` on."""

    def extremes(self, rig: Rig) -> Iterator[Group]:
        """Yield what its own keys may be, at the ends of their ranges and between."""

    def books(self, made: Simulation) -> tuple[float, float]:
        """Return residual and energy generated over a simulation [J]."""


def bench_hooks() -> BenchHooks:
    """Return the hooks.

    Raises
    ------
    ConfigError
        The package is not installed, or does not import.
    """
    hooks: BenchHooks = registry.control_hooks(SCENE, "bench")
    return hooks
