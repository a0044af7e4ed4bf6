"""Points of a work-precision diagram and the Pareto front."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

ROUNDS = 5
"""Timings of a run; the best counts of those taken on an undisturbed core."""


class Point(NamedTuple):
    """One method at one step on one scene.

    Attributes
    ----------
    step_s : float
        [s] Sub-step, or the tolerance [1] of a method that chooses its own (`adaptive`).
    error : float
        Of the state, as a share of the scene's own scale; see `Scene.what`.
    energy_error : float
        Share of the energy at the start that the method made or took; NaN where it is not known.
    cpu_s : float
        CPU time per simulated second [s].
    peer : bool
        Not tautwave's.
    """

    scene: str
    method: str
    step_s: float
    error: float
    energy_error: float
    cpu_s: float
    adaptive: bool = False
    peer: bool = False


class Scene(NamedTuple):
    """A scene with its points. `chosen` is what `auto` takes at 1 ms, or what `label` says."""

    name: str
    what: str
    points: tuple[Point, ...]
    chosen: Point | None
    why: str
    notes: tuple[str, ...] = ()
    label: str = "auto at 1 ms"


def pareto(points: Iterable[Point]) -> list[Point]:
    """Return the points that no other beats in both error and CPU time, by falling error."""
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cpu_s, p.error)):
        if math.isfinite(point.error) and (not front or point.error < front[-1].error):
            front.append(point)
    return front
