"""What a run costs, and which point of a work-precision diagram is the cheapest."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from tautwave.bench.chunks import TOLERANCE, calibrate
from tautwave.bench.precision.points import ROUNDS, Point

LONG_NS = 50_000_000
"""CPU time of a run that is timed once."""


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


def cheapest(points: Sequence[Point], error: float) -> Point | None:
    """Return the cheapest point with at most this error, None if there is none."""
    good = [point for point in points if point.error <= error]
    return min(good, key=lambda p: p.cpu_s) if good else None
