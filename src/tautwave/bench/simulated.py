"""`simulate`, compiled: one step of whole rigs.

Setting the tables up is not part of the figures.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from tautwave.bench.chunks import Cost, Work, costs
from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.result import Table, Value
from tautwave.bench.rigs import BenchRig

STATE = ("outcomes", "axes", "samples", "bodies", "states", "table")
"""Tables that a run changes and that are put back before the next."""

Kernel = Callable[..., int]


def simulate_costs(rigs: Sequence[BenchRig], rounds: int, seconds: float | None = None) -> Table:
    """Return what a step of each rig costs.

    Parameters
    ----------
    rigs : sequence of BenchRig
        What is simulated.
    rounds : int
        Chunks per figure; a chunk is a whole simulation.
    seconds : float, optional
        Simulated time of a run [s]; the rig's own if not given.
    """
    if not has_numba():
        return _table([[rig.name, None, NO_NUMBA] for rig in rigs])
    rows: list[list[Value]] = []
    for rig in rigs:
        steps, cost = _measure(rig, rounds, seconds)
        rows.append([rig.name, cost.best_ns / steps, cost.median_ns / steps])
    return _table(rows)


def _measure(
    rig: BenchRig, rounds: int, seconds: float | None, kernel: Kernel | None = None
) -> tuple[int, Cost]:
    """Return steps of a run, and what a run costs."""
    from tautwave.simulation.kernel.compiled import compiled_kernel
    from tautwave.simulation.kernel.pack import pack_rig
    from tautwave.simulation.kernel.tables import record_tables

    job = pack_rig(rig.load(), seconds)
    works = {rig.name: run_work(kernel or compiled_kernel(job.law), record_tables(job))}
    return job.run.cycles, costs(works, rounds)[rig.name]


def run_work(kernel: Kernel, tables: Any) -> Work:
    """Return the work of running a kernel anew on its tables; putting them back is not counted."""
    fresh = {name: getattr(tables, name).copy() for name in STATE}

    def work(n: int) -> float:
        spent = 0
        for _ in range(n):
            for name, values in fresh.items():
                getattr(tables, name)[:] = values
            began = time.thread_time_ns()
            kernel(tables)
            spent += time.thread_time_ns() - began
        return spent * 1e-9

    return work


def _table(rows: list[list[Value]]) -> Table:
    return Table(
        "Simulate: one step of the whole rig, all rows written",
        "CPU time of a whole simulation per step, set-up left out; numba without fastmath",
        ("rig", "best_ns", "median_ns"),
        rows,
    )
