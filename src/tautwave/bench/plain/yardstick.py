"""`simulate`, compiled, against the same algorithm in plain C.

Both engines run the same kernel on the same tables: numba compiles its Python text, gcc (-O2
-ffp-contract=off) its translation to C. Setting the tables up is not part of the figures.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.bench.chunks import Cost, Work, costs
from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.result import Goal, Table, Value
from tautwave.bench.rigs import BenchRig

LIMIT = 1.3
NO_GCC = "gcc is not installed"
STATE = ("outcomes", "axes", "samples", "bodies", "states", "table")
"""Tables that a run changes and that are put back before the next."""

Kernel = Callable[..., int]


def simulate_costs(
    rigs: Sequence[BenchRig], rounds: int, seconds: float | None = None
) -> tuple[Table, list[Goal]]:
    """Return the table of both engines and the goals on their ratio.

    Parameters
    ----------
    rigs : sequence of BenchRig
        What is simulated.
    rounds : int
        Chunks per figure; a chunk is a whole simulation.
    seconds : float, optional
        Simulated time of a run [s]; the rig's own if not given.
    """
    if not has_numba() or shutil.which("gcc") is None:
        why_not = NO_GCC if has_numba() else NO_NUMBA
        goals = [_goal(rig, None, why_not) for rig in rigs]
        return _table([[rig.name, None, None, None, None, why_not] for rig in rigs]), goals
    from tautwave.simulation.kernel.cbuild import c_kernel
    from tautwave.simulation.kernel.compiled import compiled_kernel

    engines: dict[str, Kernel] = {"compiled": compiled_kernel(), "c": c_kernel()}
    rows: list[list[Value]] = []
    goals = []
    for rig in rigs:
        steps, found, equal = _measure(rig, engines, rounds, seconds)
        fast, plain = (found[name].best_ns / steps for name in engines)
        ratio = found["compiled"].median_ns / found["c"].median_ns
        rows.append([rig.name, fast, plain, fast / plain, ratio, "yes" if equal else "NO"])
        goals.append(_goal(rig, ratio, ""))
    return _table(rows), goals


def _measure(
    rig: BenchRig, engines: Mapping[str, Kernel], rounds: int, seconds: float | None
) -> tuple[int, dict[str, Cost], bool]:
    """Return steps of a run, the cost of a run per engine, and whether all rows are equal."""
    from tautwave.simulation.kernel.pack import pack_rig
    from tautwave.simulation.kernel.tables import record_tables

    job = pack_rig(rig.load(), seconds)
    tables = {name: record_tables(job) for name in engines}
    works = {name: _work(kernel, tables[name]) for name, kernel in engines.items()}
    found = costs(works, rounds)
    first, *others = (table.out.tobytes() for table in tables.values())
    return job.run.cycles, found, all(other == first for other in others)


def _work(kernel: Kernel, tables: Any) -> Work:
    fresh = {name: getattr(tables, name).copy() for name in STATE}

    def work(n: int) -> float:
        spent = 0
        for _ in range(n):
            for name, values in fresh.items():
                getattr(tables, name)[:] = values
            began = time.thread_time_ns()
            kernel(*tables)
            spent += time.thread_time_ns() - began
        return spent * 1e-9

    return work


def _goal(rig: BenchRig, ratio: float | None, why_not: str) -> Goal:
    name = f"simulate, {rig.name}: compiled against plain C"
    return Goal(name, LIMIT, "times", ratio, why_not=why_not)


def _table(rows: list[list[Value]]) -> Table:
    return Table(
        "Simulate: one step of the whole rig, all rows written",
        "CPU time of a whole simulation per step, engines in turn, set-up left out; numba "
        "without fastmath against gcc -O2 -ffp-contract=off on the same kernel; ratios of best "
        "and of median runs; equal: every row the same to the bit",
        ("rig", "compiled_best_ns", "c_best_ns", "best_ratio", "median_ratio", "equal"),
        rows,
    )
