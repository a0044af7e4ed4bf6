"""An operated bench on the fake clock: its rows by column, and its journal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig, load_rig
from tautwave.rig import build_rig
from tautwave.runtime.loop import Loop, LoopResult
from tautwave.runtime.operate.commands import DeadMan, Script, Source, read_script
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.session.operating import with_operation

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
STANDING = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [1, 0.1]]}"
BARE = ("coupling.pairs.lever.wall_master=null", "coupling.pairs.lever.wall_slave=null")
STILL = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [9, 0]]}"
FREE = "simulation.environment.lever={type: free}"


class Rows:
    """A sink that keeps every row."""

    def __init__(self, columns: Sequence[str]) -> None:
        self.row: Any = [0.0] * len(columns)
        self.kept: list[list[float]] = []

    def commit(self) -> None:
        self.kept.append(list(self.row))


class Operated(NamedTuple):
    """What came of it."""

    columns: Mapping[str, npt.NDArray[np.float64]]
    control: OperatedControl
    result: LoopResult

    def words(self) -> list[tuple[str, str]]:
        """Return the journal as words and the states after them."""
        return [(entry.word, entry.state) for entry in self.control.journal.entries]

    def residual(self) -> npt.NDArray[np.float64]:
        """Return what the books of the pair do not explain, row by row [J]."""
        ports = [c for name, c in self.columns.items() if name.endswith(".port_energy")]
        stored = [c for name, c in self.columns.items() if name.endswith(".stored")]
        lost = [c for name, c in self.columns.items() if name.endswith(".dissipated")]
        return np.asarray(sum(ports) - sum(stored) - sum(lost))


def bench(*overrides: str) -> Rig:
    """Return the bench with an `operate` block."""
    return load_rig(BENCH, ["operate={}", *overrides])


def operate(
    rig: Rig,
    script: str,
    duration_s: float,
    dead_men: Sequence[DeadMan] = (),
    live: Sequence[Source] = (),
) -> Operated:
    """Run an operated rig under a script of commands."""
    assembly = build_rig(rig, clock="fake", duration_s=duration_s, allow_unwatched=True)
    assembly = with_operation(rig, assembly, [Script(read_script(script, "script"))], live)
    control = assembly.control
    assert isinstance(control, OperatedControl)
    control.inbox.dead_men = dead_men or control.inbox.dead_men
    sink = Rows(assembly.columns)
    loop = Loop(assembly.clock, assembly.buses, control, assembly.sources, sink)
    result = loop.run()
    table = np.array(sink.kept)
    return Operated(dict(zip(assembly.columns, table.T, strict=True)), control, result)
