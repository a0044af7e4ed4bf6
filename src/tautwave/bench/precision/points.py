"""Points of a work-precision diagram, the Pareto front, and how runs are timed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

from tautwave.bench.chunks import TOLERANCE, calibrate

ROUNDS = 5
"""Timings of a run; the best counts of those taken on an undisturbed core."""

LONG_NS = 50_000_000
"""CPU time of a run that is timed once."""


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


def cpu_time(run: Callable[[], object], simulated_s: float, rounds: int = ROUNDS) -> float:
    """Return CPU time per simulated second [s] of a run that simulates `simulated_s` [s]."""
    run()
    began = time.thread_time_ns()
    run()
    once = max(time.thread_time_ns() - began, 1)
    if once > LONG_NS:
        return 1e-9 * once / simulated_s  # a slow peer: more digits are not worth the wait
    times = max(1, min(1000, round(1_000_000 / once)))
    taken: list[tuple[int, float]] = []
    for _ in range(rounds):
        before = calibrate()
        began = time.thread_time_ns()
        for _ in range(times):
            run()
        spent = (time.thread_time_ns() - began) / times
        taken.append((max(before, calibrate()), spent))
    quickest = min(speed for speed, _ in taken)
    quiet = [spent for speed, spent in taken if speed <= TOLERANCE * quickest]
    return 1e-9 * min(quiet) / simulated_s


def pareto(points: Iterable[Point]) -> list[Point]:
    """Return the points that no other beats in both error and CPU time, by falling error."""
    front: list[Point] = []
    for point in sorted(points, key=lambda p: (p.cpu_s, p.error)):
        if math.isfinite(point.error) and (not front or point.error < front[-1].error):
            front.append(point)
    return front


def cheapest(points: Sequence[Point], error: float) -> Point | None:
    """Return the cheapest point with at most this error, None if there is none."""
    good = [point for point in points if point.error <= error]
    return min(good, key=lambda p: p.cpu_s) if good else None
