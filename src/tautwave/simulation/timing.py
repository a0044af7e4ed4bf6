"""CPU time of a simulated step, engine by engine; for `tautwave bench`."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

from tautwave.config import Rig
from tautwave.simulation.kernel.pack import pack_rig
from tautwave.simulation.kernel.tables import Tables
from tautwave.simulation.run import engine_of


def step_seconds(
    rig: Rig,
    *,
    engines: Sequence[str] = ("compiled", "c"),
    duration_s: float | None = None,
    repeats: int = 20,
) -> dict[str, list[float]]:
    """Measure the CPU time of one simulated step [s], without compiling and setting up.

    The engines take turns, so the n-th figures of two of them were taken next to each other and
    their quotient is worth more than that of two medians.

    Parameters
    ----------
    rig : Rig
        A rig with a `simulation` block.
    engines : sequence of str
        Of `compiled`, `c` and `python`.
    duration_s : float, optional
        Simulated time of one run [s]; the rig's own if not given.
    repeats : int
        Runs per engine.

    Returns
    -------
    dict of list of float
        Seconds per step, by engine, one for each repeat.
    """
    job = pack_rig(rig, duration_s)
    found = {name: engine_of(name) for name in engines}
    tables = {name: tables_of(job) for name, (_, tables_of) in found.items()}
    for name, (run, _) in found.items():
        run(*tables[name])  # compiles, and touches every page of the rows
    times: dict[str, list[float]] = {name: [] for name in engines}
    for _ in range(repeats):
        for name, (run, tables_of) in found.items():
            used = again(tables[name], tables_of(job))
            began = time.thread_time_ns()
            rows = run(*used)
            times[name].append((time.thread_time_ns() - began) * 1e-9 / rows)
    return times


def again(used: Tables, fresh: Tables) -> Tables:
    """Return fresh tables with the rows of used ones, whose memory is there already."""
    return fresh._replace(out=used.out)


def ratios(times: dict[str, list[float]], engine: str, against: str) -> list[float]:
    """Return the quotients of two engines' times, turn by turn, in rising order."""
    pairs = zip(times[engine], times[against], strict=True)
    return sorted(float(np.divide(one, other)) for one, other in pairs)
