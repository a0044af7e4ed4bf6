"""What the port costs: its steps in plain Python, and a compiled step of the bench."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from tautwave.bench.chunks import costs
from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.live.think import PARTS, SiteCase, part_costs
from tautwave.bench.result import Goal, Table, Value
from tautwave.bench.simulated import run_work
from tautwave.config import Rig
from tautwave.rig import command_delays, coupling_law, end_constants, site_params
from tautwave.simulation.kernel.pack import pack_rig
from tautwave.simulation.kernel.tables import record_tables
from tests.lab.port.hold import HELD
from tests.lab.port.rigs import CONTACTS, bench_rig

FIRST_S, SECONDS = 1.0, 6.0
"""In the first second, after the engage ramp has cut efforts, every port is watched."""

COMPARED = ("before", "after")


def port_costs(rounds: int, tell: Callable[[str], None]) -> tuple[Table, list[Goal]]:
    """Return think, close and kernel of the port before and after, and their goals."""
    # Nothing sticks and nothing is met: a device whose friction stops it, which chatter does,
    # costs ten times its step.
    rigs = {
        f"{port}, {seconds:g} s": bench_rig(
            port, HELD, CONTACTS["free"], noise=9e-5, seconds=seconds, coulomb=0.0
        )
        for seconds in (FIRST_S, SECONDS)
        for port in COMPARED
    }
    tell("steps of the port, plain Python")
    cases = []
    for port in COMPARED:
        rig = rigs[f"{port}, {SECONDS:g} s"]
        delay = command_delays(rig)["master.lever"]
        end = end_constants(rig, "master.lever", delay)
        cases.append(
            SiteCase(port, site_params(rig, "master.lever", delay), coupling_law(rig), end)
        )
    taken = part_costs(cases, rounds)
    rows: list[list[Value]] = []
    for part in PARTS:
        before, after = (taken[port][part].median_ns for port in COMPARED)
        rows.append([f"{part}, plain Python", before, after, after / before])
    kernel = None
    if has_numba():
        tell("a step of the bench, compiled (numba compiles for a minute)")
        steps = step_costs(rigs, rounds)
        for seconds in (FIRST_S, SECONDS):
            old, new = (steps[f"{port}, {seconds:g} s"] for port in COMPARED)
            kernel = new / old
            rows.append([f"step of the bench, compiled, {seconds:g} s", old, new, kernel])
    table = Table(
        "What the port costs, per axis and cycle",
        "CPU time in chunks between two calibrations, median; both in the controller as it is now, "
        "on devices without Coulomb friction that meet nothing; in the first second, after a ramp "
        "that cuts efforts, each end of the port after is watched for a lost coupling",
        ("part", "before_ns", "after_ns", "ratio"),
        rows,
    )
    spent = {part: 1e-3 * taken["after"][part].median_ns for part in PARTS}
    return table, [
        Goal("think of the port, plain Python", 2.5, "us", spent["think"]),
        Goal("close of the port, plain Python", 1.5, "us", spent["close"]),
        Goal(
            f"compiled step over the port before, {SECONDS:g} s",
            1.15,
            "times",
            kernel,
            why_not="" if kernel is not None else NO_NUMBA,
        ),
    ]


def step_costs(rigs: Mapping[str, Rig], rounds: int) -> dict[str, float]:
    """Return the median CPU time of a compiled step of each rig [ns], measured in turn."""
    from tautwave.simulation.kernel.compiled import compiled_kernel

    jobs = {name: pack_rig(rig, None) for name, rig in rigs.items()}
    works = {
        name: run_work(compiled_kernel(job.law), record_tables(job)) for name, job in jobs.items()
    }
    taken = costs(works, rounds)
    return {name: taken[name].median_ns / job.run.cycles for name, job in jobs.items()}
