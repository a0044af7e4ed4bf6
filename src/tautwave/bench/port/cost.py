"""What the port costs: its steps in plain Python, and a compiled step of the bench."""

from __future__ import annotations

from collections.abc import Callable

from tautwave.bench.calls import SITE
from tautwave.bench.chunks import costs
from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.live.think import PARTS, SiteCase, works_of
from tautwave.bench.port.hold import HELD, WALL
from tautwave.bench.port.rigs import bench_rig
from tautwave.bench.result import Goal, Table, Value
from tautwave.bench.simulated import step_costs
from tautwave.rig import command_delays, coupling_law, end_constants

SECONDS = 1.0
COMPARED = ("before", "after")


def port_costs(rounds: int, tell: Callable[[str], None]) -> tuple[Table, list[Goal]]:
    """Return think, close and kernel of the port before and after, and their goals."""
    rigs = {port: bench_rig(port, HELD, WALL, noise=9e-5, seconds=SECONDS) for port in COMPARED}
    tell("steps of the port, plain Python")
    cases = []
    for port, rig in rigs.items():
        delay = command_delays(rig)["master.lever"]
        end = end_constants(rig, "master.lever", delay)
        cases.append(SiteCase(port, SITE, coupling_law(rig), end))
    taken = costs(works_of(cases), rounds)
    rows: list[list[Value]] = []
    for part in PARTS:
        before, after = (taken[f"{port}/{part}"].median_ns for port in COMPARED)
        rows.append([f"{part}, plain Python", before, after, after / before])
    kernel = None
    if has_numba():
        tell("a step of the bench, compiled (numba compiles for a minute)")
        steps = step_costs(rigs, rounds)
        kernel = steps["after"] / steps["before"]
        rows.append(["step of the bench, compiled", *steps.values(), kernel])
    table = Table(
        "What the port costs, per axis and cycle",
        "CPU time in chunks between two calibrations, median; both in the controller as it is now; "
        "before writes no books",
        ("part", "before_ns", "after_ns", "ratio"),
        rows,
    )
    spent = {part: 1e-3 * taken[f"after/{part}"].median_ns for part in PARTS}
    return table, [
        Goal("think of the port, plain Python", 2.5, "us", spent["think"]),
        Goal("close of the port, plain Python", 1.5, "us", spent["close"]),
        Goal(
            "compiled step, over the port before",
            1.15,
            "times",
            kernel,
            why_not="" if kernel is not None else NO_NUMBA,
        ),
    ]
