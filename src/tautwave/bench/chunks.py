"""CPU time of short pieces of work on a shared machine.

Works are measured in turn, in chunks of about a millisecond, each between two runs of a calibration
kernel. A chunk counts only when both runs were nearly as fast as the best one seen: then the core
was undisturbed and at its normal clock. Times are CPU time of this thread [ns].
"""

from __future__ import annotations

import time
import timeit
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from typing import Any, NamedTuple

CHUNK_NS = 1_000_000
TOLERANCE = 1.15
"""Allowed slowdown of the calibration around a chunk that counts."""

Work = Callable[[int], float]
"""Does something `n` times and returns the CPU time it took [s]."""


class Cost(NamedTuple):
    """CPU time of one call [ns]: best and median chunk, and how many chunks counted."""

    best_ns: float
    median_ns: float
    counted: int
    taken: int


def calibrate() -> int:
    """Return the CPU time [ns] of a fixed piece of plain Python, about 0.1 ms."""
    began = time.thread_time_ns()
    a = 1.0
    for _ in range(2_000):
        a = a * 0.999 + 0.5
    return time.thread_time_ns() - began


def calling(function: Callable[..., Any], *arguments: Any) -> Work:
    """Return the work of calling `function(*arguments)`; includes the bare loop, some 10 ns."""
    names = [f"a{at}" for at in range(len(arguments))]
    bind = "".join(f"{name}=arguments[{at}];" for at, name in enumerate(names))
    timer = timeit.Timer(
        f"function({','.join(names)})",
        f"function=the_function;{bind}",
        timer=time.thread_time,
        globals={"the_function": function, "arguments": arguments},
    )
    return timer.timeit


def costs(works: Mapping[str, Work], rounds: int, chunk_ns: float = CHUNK_NS) -> dict[str, Cost]:
    """Measure all works in turn, `rounds` chunks each."""
    sizes = {name: _size(work, chunk_ns) for name, work in works.items()}
    taken: dict[str, list[tuple[int, float]]] = {name: [] for name in works}
    for _ in range(rounds):
        before = calibrate()
        for name, work in works.items():
            spent = work(sizes[name]) * 1e9 / sizes[name]
            after = calibrate()
            taken[name].append((max(before, after), spent))
            before = after
    best = min(speed for chunks in taken.values() for speed, _ in chunks)
    return {name: summary(chunks, best) for name, chunks in taken.items()}


def summary(chunks: Sequence[tuple[int, float]], best: int) -> Cost:
    """Return the cost of a work from (slower calibration, ns per call) of its chunks."""
    quiet = [spent for speed, spent in chunks if speed <= TOLERANCE * best]
    # On a machine that is never quiet, use the quietest quarter.
    if len(quiet) < max(1, len(chunks) // 8):
        ranked = sorted(chunks)
        quiet = [spent for _, spent in ranked[: max(1, len(ranked) // 4)]]
    return Cost(min(quiet), median(quiet), len(quiet), len(chunks))


def _size(work: Work, chunk_ns: float) -> int:
    """Return how often to call for a chunk of `chunk_ns`; the first call warms up."""
    work(1)
    size = 1
    while size < 1_000_000:
        spent = work(size) * 1e9
        if spent > 0.25 * chunk_ns:
            return max(1, round(size * chunk_ns / spent))
        size *= 4
    return size
