"""One closed-loop simulation of a rig as columns, by the same kernel as `simulate`, in memory.

What only needs a few columns of one pair gets only those: the rows of a whole recording cost a
fifth of a compiled step, and looking through them more.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.config.keys.rig import bus_spec
from tautwave.errors import SafetyStop
from tautwave.offline.outcome import error_of
from tautwave.offline.pack import Job, RigFacts, pack_rig, rig_facts
from tautwave.offline.rows import measured_columns
from tautwave.offline.simulation import engine_of
from tautwave.offline.sweep_library import kept_kernel
from tautwave.offline.sweep_points import Point
from tautwave.offline.tables import Tables, record_tables

Floats = npt.NDArray[np.float64]
Columns = dict[str, Floats]

WORTH_COMPILING = 1_000_000
"""Steps below which plain Python is done before a compiler or its cache is loaded."""

BOOKS = ("gross_flow", "residual", "generated")
"""Measures that look at every account of a recording."""


def sweep_engine(steps: int) -> str:
    """Return the engine for a sweep of so many steps: the fastest to the end that is there."""
    if steps < WORTH_COMPILING:
        return "python"
    if shutil.which("gcc") is not None:
        return "c"
    return "compiled" if find_spec("numba") is not None else "python"


def takes_rows(wanted: tuple[str, ...]) -> bool:
    """Return whether measures need whole rows."""
    return any(name in BOOKS for name in wanted)


def _engine(name: str) -> tuple[Callable[..., int], Callable[[Job], Tables]]:
    """Return an engine as `simulation.engine_of` does; C from where it is kept."""
    if name == "c":
        with suppress(OSError):
            return kept_kernel(), record_tables
    return engine_of(name)


class Simulator:
    """Simulates one point after the other; the memory of the rows is used again.

    Parameters
    ----------
    engine : str
        Of `simulate`.
    whole : bool
        Keep whole rows, not only what `rows.measured_columns` names.
    """

    def __init__(self, engine: str, *, whole: bool) -> None:
        self._run, self._tables_of = _engine(engine)
        self._whole = whole
        self._out = np.empty(0)
        self._known: tuple[list[Any], RigFacts] | None = None

    def __call__(self, point: Point) -> tuple[Columns, int, str]:
        """Return columns, cycles and outcome; the columns hold until the next call.

        Raises
        ------
        ConfigError
            The rig cannot be simulated.
        """
        return self.simulate(point.rig, point.pair, point.duration_s)

    def simulate(self, rig: Rig, pair: str, duration_s: float) -> tuple[Columns, int, str]:
        """Simulate a rig; see `__call__`."""
        job = pack_rig(rig, duration_s, None if self._whole else self._facts(rig))
        if not self._whole:
            number = list(rig.coupling.pairs).index(pair)
            run = job.run._replace(measured=number)
            job = job._replace(run=run, columns=measured_columns(pair))
        tables = self._tables(job)
        count = self._run(*tables)
        width = len(job.columns)
        table = np.asarray(tables.out[: count * width], dtype=np.float64).reshape(count, width)
        if not self._whole:
            table = np.ascontiguousarray(table.T).T
        columns = {name: table[:, at] for at, name in enumerate(job.columns)}
        return columns, count, _outcome(job, tables)

    def _facts(self, rig: Rig) -> RigFacts:
        """Return the facts of the last rig if its drivers would get to see the same."""
        seen = [(bus.driver, bus.options, bus_spec(rig, name)) for name, bus in rig.buses.items()]
        if self._known is None or self._known[0] != seen:
            self._known = seen, rig_facts(rig)
        return self._known[1]

    def _tables(self, job: Job) -> Tables:
        tables = self._tables_of(job)
        if isinstance(tables.out, np.ndarray):
            if len(self._out) < len(tables.out):
                self._out = tables.out
            tables = tables._replace(out=self._out)
        return tables


def _outcome(job: Job, tables: Tables) -> str:
    """Return `finished`, `safety_stop` (a limit was passed) or `fault`."""
    outcomes = tables.outcomes
    if isinstance(outcomes, np.ndarray):
        outcomes = outcomes.view(np.recarray)
    error = error_of(job, outcomes[0])
    if error is None:
        return "finished"
    return "safety_stop" if isinstance(error, SafetyStop) else "fault"


def simulate_rows(rig: Rig, duration_s: float, engine: str = "python") -> tuple[Columns, int, str]:
    """Return the columns of a simulation, its cycles, and how it ended.

    The end is `finished`, `safety_stop` (a limit was passed: columns up to there) or `fault`.
    """
    pair = next(iter(rig.coupling.pairs))
    return Simulator(engine, whole=True).simulate(rig, pair, duration_s)
