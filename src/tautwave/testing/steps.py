"""A coupling's steps in the controller itself, moved by hand: what `CouplingContract` looks at."""

from __future__ import annotations

import math
import random
import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.records import AxisParams, PairParams, RunParams
from tautwave.controller.steps import Law, NoParams
from tautwave.controller.stops import AxisName
from tautwave.laws.limit import LimitParams
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import NO_WALL
from tautwave.registry import load_named
from tautwave.runtime.control import Control, CoupledControl
from tautwave.types import JointState

T = 1e-3
AXIS = CoupledAxis(T, 1.0, 1e-3, 0.0, 0.0, 0, 0.0, velocity_limit=100.0, effort_limit=10.0)
"""A typical axis: 1 kHz, 1e-3 kg or kg m**2, no filter or command delay, 100 rad/s or m/s,
10 N m or N."""

WIDE = LimitParams(effort=1e6)
SITE = SiteParams(T, 0.5 * T / 1e-3, NO_WALL, WIDE, 1.0, 0.0, has_wall=False)
CYCLES = 3000

Move = tuple[float, float, bool, bool, int]
"""Positions of both sides, whether there is a sample of each, and slots that went by unseen."""


class Driven(NamedTuple):
    """What a drive left: a row per cycle by column, and the reason to stop, if there was one."""

    columns: Sequence[str]
    rows: Sequence[Sequence[float]]
    reason: str

    def column(self, name: str) -> list[float]:
        """Return one column."""
        at = list(self.columns).index(name)
        return [row[at] for row in self.rows]


def controller(plugin: CouplingPlugin, coupling: Any, samples: int = 0) -> CoupledControl:
    """Return the controller of a coupling's first pair, its line `samples` slots long."""
    law: Law = load_named(plugin.law)
    [(name, pair)] = coupling.pairs.items()
    make = load_named(plugin.end_constants)
    link = NoParams()
    if plugin.link_constants:
        link = load_named(plugin.link_constants)(coupling, T)
    params = [
        AxisParams(
            SITE, 0.5 * T, 0.0, WIDE.effort, 1.0, 0, 0, True, 1, 0.5 * T, make(pair, side, AXIS)
        )
        for side in ("master", "slave")
    ]  # fmt: skip
    q = PairParams(
        0, 1, False, True, 1.0, 1.0, 1.0, 1.0, 1.0, T, 0.5 * T, 0.0, math.inf, samples, 0, link
    )
    run = RunParams(round(1e9 * T), 10 * CYCLES, 2, 1, 0, 5, 1000, 1000, 0.1, 5e9)
    names = [AxisName(f"{side}.{name}", side, "rad") for side in ("master", "slave")]
    table = [0.0] * (law.rings * samples)
    return CoupledControl(run, names, params, [name], [q], table, law)


def at_random(seed: int = 1, cycles: int = CYCLES) -> Iterator[Move]:
    """Yield positions of a smooth unrest, with lost samples and skipped slots."""
    draw = random.Random(seed)
    x = [0.0, 0.0]
    v = [0.0, 0.0]
    for _ in range(cycles):
        for i in range(2):
            v[i] = 0.98 * v[i] + draw.gauss(0.0, 0.01) - 0.05 * x[i]
            x[i] += T * v[i]
        lost = [draw.random() < 0.03 for _ in range(2)]
        skipped = 2 if draw.random() < 0.01 else 0
        yield x[0], x[1], not lost[0], not lost[1], skipped


def there_and_back(cycles: int = CYCLES) -> Iterator[Move]:
    """Yield a slow motion of both sides, out of step, that ends at rest where it began."""
    for k in range(cycles):
        phase = 2.0 * math.pi * k / (cycles - 1)
        rise = 0.5 - 0.5 * math.cos(phase)
        yield 0.1 * rise * math.sin(phase), 0.05 * rise * math.sin(2.0 * phase), True, True, 0


def drive(control: Control, moves: Iterator[Move]) -> Driven:
    """Let a controller think about motions that nothing stops."""
    rows: list[list[float]] = []
    slot = 0
    width = len(control.columns)
    for one, two, seen_one, seen_two, skipped in moves:
        slot += skipped
        for which, (x, seen) in enumerate(((one, seen_one), (two, seen_two))):
            control.take(which, JointState(x, math.nan, math.nan, seen, 0), slot)
        if not control.step(slot, skipped):
            break
        row = [0.0] * width
        control.fill(row, 0)
        rows.append(row)
        slot += 1
    error = control.error()
    return Driven(control.columns, rows, "" if error is None else str(error))


def allocated(control: Control, moves: Iterator[Move]) -> int:
    """Return the bytes that cycles hold at once, or keep [B], beyond what they began with."""
    given = list(moves)
    once = len(given) // 2
    row = [0.0] * len(control.columns)

    def cycles(part: Sequence[Move], first: int) -> None:
        for at, (one, two, _, _, _) in enumerate(part, first):
            control.take(0, JointState(one, math.nan, math.nan, True, 0), at)
            control.take(1, JointState(two, math.nan, math.nan, True, 0), at)
            control.step(at, 0)
            control.fill(row, 0)

    cycles(given[:once], 0)
    rest = given[once:]
    return _peak(lambda: cycles(rest, once))


def _peak(work: Callable[[], None]) -> int:
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        work()
        return tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
