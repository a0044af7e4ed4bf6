"""One closed-loop simulation of a rig as columns: the live loop on the fake clock, in memory."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.errors import SafetyStop, TautwaveError
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop

Floats = npt.NDArray[np.float64]


class _Memory:
    """Rows in one array; the loop fills `row` and commits it."""

    def __init__(self, width: int, rows: int) -> None:
        self.row = [0.0] * width
        self.table = np.empty((rows, width))
        self.count = 0

    def commit(self) -> None:
        self.table[self.count] = self.row
        self.count += 1


def simulate_rows(rig: Rig, duration_s: float) -> tuple[dict[str, Floats], int, str]:
    """Return the columns of a simulation, its cycles, and how it ended.

    The end is `finished`, `safety_stop` (a limit was passed: columns up to there) or `fault`.

    Raises
    ------
    KeyboardInterrupt
        Ctrl-C.
    """
    assembly = build_rig(rig, clock="fake", duration_s=duration_s)
    sink = _Memory(len(assembly.columns), assembly.settings.cycles + 1)
    loop = Loop(
        assembly.clock,
        assembly.settings,
        assembly.buses,
        assembly.pairs,
        assembly.sources,
        sink,
    )
    with np.errstate(all="ignore"):
        result = loop.run()
    if isinstance(result.error, KeyboardInterrupt):
        raise result.error
    if result.error is not None and not isinstance(result.error, TautwaveError):
        raise result.error
    outcome = "finished"
    if result.error is not None:
        outcome = "safety_stop" if isinstance(result.error, SafetyStop) else "fault"
    rows = sink.table[: sink.count]
    return {name: rows[:, at] for at, name in enumerate(assembly.columns)}, result.cycles, outcome
