"""Stiff and extreme: every model and whole rigs where numbers are hardest, and very many steps."""

from __future__ import annotations

from collections.abc import Callable

from tautwave.bench.compiled import has_numba
from tautwave.bench.extremes import rig_table
from tautwave.bench.result import Goal, Suite
from tautwave.bench.rigs import ONE_PAIR
from tests.lab.extremes.bounce import bounce_tables
from tests.lab.extremes.long import long_table

STEPS = 10_000_000
FULL = 1_000_000_000
RIG_S = 9.0


def extremes(*, full: bool = False, tell: Callable[[str], None] = lambda _: None) -> Suite:
    """Measure bounces, whole rigs, and many steps of scenes that lose nothing.

    Parameters
    ----------
    full : bool
        1e9 steps of the conservative scenes, which takes minutes, in place of 1e7.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    tell("bounces, scheme by scheme")
    tables, found = bounce_tables()
    tell("whole rigs")
    engine = "compiled" if has_numba() else "python"
    rigs, broken = rig_table(ONE_PAIR.path(), duration_s=RIG_S, engine=engine)
    steps = FULL if full else STEPS
    tell(f"{steps:.0e} steps of conservative scenes")
    long, drift, lost = long_table(steps)
    not_finite = sum(one.not_finite for one in found.values()) + broken + lost
    not_finite += sum(int(row[7] or 0) for row in tables[1].rows)
    gradient = found["discrete_gradient"]
    goals = [
        Goal("figures that are not finite, anywhere", 0.0, "", float(not_finite)),
        Goal(
            "discrete gradient, error of the exit speed, k from 1e3, up to 100 steps per contact",
            1e-13,
            "",
            gradient.usual_error,
        ),
        Goal("the same, all k, up to 1000 steps per contact", 1e-13, "", gradient.speed_error),
        Goal("discrete gradient, energy gained in a bounce", 1e-12, "", gradient.gained),
        Goal("exact, error of the exit speed", 1e-13, "", found["exact"].speed_error),
        Goal(f"energy gained over {steps:.0e} steps", 1e-9, "", drift),
    ]
    return Suite("extremes", [*tables, *rigs, long], goals)
