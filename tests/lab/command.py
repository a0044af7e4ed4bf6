"""The laboratory: `python -m tests.lab NAME` measures what the documentation claims.

What a user measures on their own machine is `tautwave bench`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from tautwave.bench.result import Suite
from tautwave.cli.group import Commands
from tautwave.cli.options import Number, Whole, json_option, out_option, positive
from tautwave.cli.terminal.measured import print_suites


class Laboratory(Commands):
    """Commands declared here; errors end as those of `tautwave` do."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names in alphabetical order."""
        return sorted(self.commands)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command of this module."""
        return self.commands.get(cmd_name)


def _all_cores(_context: object, _option: object, value: int | None) -> int:
    return value or len(os.sched_getaffinity(0))


jobs_option = click.option(
    "--jobs",
    type=Whole(1),
    callback=_all_cores,
    help="Processes [default: one for each processor core].",
)
keep_option = click.option(
    "--keep",
    type=click.Path(dir_okay=False, path_type=Path),
    help="File of the finished random cases, from which an interrupted run resumes.",
)


def recordings_option(what: str) -> Callable[..., Any]:
    """Return the option of a folder of recorded hands; `what` they are for."""
    return click.option(
        "--recordings",
        type=click.Path(file_okay=False, exists=True, path_type=Path),
        help=f"Folder of recorded hands, SET_<free|foam|spring|rigid>.csv, .mat or .mcap{what}",
    )


@click.group(cls=Laboratory)
def lab() -> None:
    """Measure what the documentation claims: comparisons, random rigs, peers, papers."""


@lab.command(short_help="Error against run time of every integrator, and of its peers.")
@click.option("--full", is_flag=True, help="More steps over more decades; takes minutes.")
@click.option(
    "--out",
    type=click.Path(file_okay=False, path_type=Path),
    help="Directory for CSV, JSON and pictures.",
)
@click.option(
    "--max-error",
    type=float,
    default=1e-4,
    show_default=True,
    callback=positive,
    help="Error bound for the chosen point of each scene.",
)
@json_option
def workprecision(full: bool, out: Path | None, max_error: float, as_json: bool) -> None:
    """Measure error against run time: scenes, schemes, steps over decades, peers.

    SciPy, python-control and MuJoCo are included if installed (the extra `bench`).

    \b
    Examples:
        python -m tests.lab workprecision --out wp
        python -m tests.lab workprecision --full --out wp
    """
    suite = _suite(
        "tests.lab.workprecision.suite",
        "workprecision",
        full=full,
        out=out,
        max_error=max_error,
        tell=_tell,
    )
    print_suites([suite], as_json)


@lab.command(short_help="Models and whole rigs at numerical extremes.")
@click.option("--full", is_flag=True, help="1e9 steps of the conservative scenes instead of 1e7.")
@out_option("Directory for the tables as CSV; default: none.")
@json_option
def extremes(full: bool, out: Path | None, as_json: bool) -> None:
    """Run stiff and extreme cases: which are refused, which go wrong, and by how much.

    Contacts from 1 to 1e9 N/m on 1 mg to 100 kg with every scheme, whole rigs with one parameter at
    its extremes, and ten million (--full: a billion) steps of lossless scenes.

    \b
    Examples:
        python -m tests.lab extremes
        python -m tests.lab extremes --full --out runs/extremes --json
    """
    from tautwave.bench.result import write_tables

    suite = _suite("tests.lab.extremes.suite", "extremes", full=full, tell=_tell)
    if out is not None:
        write_tables(suite, out)
    print_suites([suite], as_json)


@lab.command(short_help="1,000 parameter sets in SIMD lanes against one at a time.")
@json_option
def lanes(as_json: bool) -> None:
    """Measure the speed-up of a sweep that runs 16 parameter sets in SIMD lanes.

    \b
    Example:
        python -m tests.lab lanes
    """
    print_suites([_suite("tests.lab.plain.lanes", "lanes", tell=_tell)], as_json)


@lab.command(short_help="The wave port against the one before it and a laboratory's PD.")
@recordings_option("; without it hands are multisines.")
@click.option("--quick", is_flag=True, help="One hand per contact, 10 s of holding.")
@click.option("--cost", is_flag=True, help="Measure CPU time too; numba compiles for a minute.")
@click.option("--hold", type=Number(10.0, 86400.0), help="Only hold a force, for this time [s].")
@out_option("Directory for the picture of a held force; default: none.")
@json_option
def port(hold: float | None, as_json: bool, **given: Any) -> None:
    """Compare tracking, holding and cost of the wave port: before, after, lab.

    On the identified bench at 2 kHz, in one simulator. Before is the port with an account and a
    velocity filter, lab a position-position PD. Takes minutes.

    \b
    Examples:
        python -m tests.lab port --quick
        python -m tests.lab port --recordings teleop-1dof --out pictures
        python -m tests.lab port --hold 3600
    """
    if hold is None:
        suite = _suite("tests.lab.port.suite", "port", **given, tell=_tell)
    elif any(given.values()):
        raise click.UsageError("--hold can be combined with --json only; it measures nothing else")
    else:
        suite = _suite("tests.lab.port.long_hold", "holding", seconds=hold, tell=_tell)
    print_suites([suite], as_json)


@lab.command(
    short_help="Mass-interaction networks: speed relative to real time, and scaling with size."
)
@json_option
def networks(as_json: bool) -> None:
    """Measure a step of the granular scene, and of chains of 1 to 1e4 masses.

    \b
    Example:
        python -m tests.lab networks
    """
    print_suites([_suite("tests.lab.networks", "networks", tell=_tell)], as_json)


@lab.command(short_help="A pair over random networks: energy, position, force.")
@click.option("--patterns", type=click.IntRange(1), default=1000, show_default=True)
@click.option(
    "--first", type=click.IntRange(0), default=0, show_default=True, help="Seed of the first one."
)
@click.option("--hour", is_flag=True, help="Also simulate a pair for an hour; takes 30 s more.")
@jobs_option
@keep_option
@json_option
def network(
    patterns: int, first: int, hour: bool, jobs: int, keep: Path | None, as_json: bool
) -> None:
    """Run a pair over random networks, with our receiver and with common ones.

    Counts the cases in which a receiver released more energy than was sent: 0 for ours, to the bit.
    Then runs selected networks (jitter, loss, bursts, an outage) side by side, and a force held for
    two minutes on two clocks. One core runs about 5,000 patterns per minute.

    \b
    Examples:
        python -m tests.lab network
        python -m tests.lab network --patterns 100000 --keep patterns.jsonl
    """
    suite = _suite(
        "tests.lab.lines.suite",
        "network",
        patterns=patterns,
        first=first,
        hour=hour,
        jobs=jobs,
        keep=keep,
        tell=_tell,
    )
    print_suites([suite], as_json)


@lab.command(short_help="Every coupling, with and without an account: tracking, calm, energy.")
@click.option("--rigs", type=click.IntRange(0), default=1000, show_default=True)
@click.option(
    "--first", type=click.IntRange(0), default=0, show_default=True, help="Seed of the first rig."
)
@click.option(
    "--hand",
    type=click.Path(dir_okay=False, exists=True, path_type=Path),
    help="CSV file of a recorded hand with the column hand_reference [rad]; default: a multisine.",
)
@recordings_option(": also run the laboratory's own law on them.")
@click.option(
    "--frontier",
    is_flag=True,
    help="Error over motor noise instead: settings of each coupling on every recorded hand, a "
    "figure, and the laboratory's points in it.",
)
@click.option(
    "--delays",
    is_flag=True,
    help="Delays of 0.2 to 0.5 s instead: what the hand feels of a free, soft and rigid slave.",
)
@click.option(
    "--quick",
    is_flag=True,
    help="One delay, 0.6 s each, without compiling; with --frontier: one hand each, two settings.",
)
@jobs_option
@keep_option
@out_option("Directory for the figure of --frontier; default: none.")
@json_option
def couplings(
    rigs: int,
    first: int,
    hand: Path | None,
    recordings: Path | None,
    frontier: bool,
    delays: bool,
    quick: bool,
    jobs: int,
    keep: Path | None,
    out: Path | None,
    as_json: bool,
) -> None:
    """Compare couplings under equal conditions, and random rigs with and without an account.

    The first run compiles nine numba kernels, which takes minutes; after that, 1,000 rigs take half
    a minute.

    \b
    Examples:
        python -m tests.lab couplings --rigs 200
        python -m tests.lab couplings --rigs 10000 --keep rigs.jsonl
        python -m tests.lab couplings --frontier --recordings teleop-1dof --out pictures
        python -m tests.lab couplings --delays
    """
    if delays:
        suite = _suite("tests.lab.couplings.long_delays", "long_delays", tell=_tell)
    elif frontier:
        suite = _suite(
            "tests.lab.couplings.frontier_suite",
            "frontier_suite",
            recordings=recordings,
            quick=quick,
            out=out,
            tell=_tell,
        )
    else:
        suite = _suite(
            "tests.lab.couplings.suite",
            "couplings",
            rigs=rigs,
            first=first,
            hand=hand,
            recordings=recordings,
            quick=quick,
            jobs=jobs,
            keep=keep,
            tell=_tell,
        )
    print_suites([suite], as_json)


@lab.command(short_help="What `law: auto` leaves on recorded hands, beside tuned settings.")
@recordings_option("; without it hands are multisines.")
@click.option("--quick", is_flag=True, help="One hand per contact, master imposed, no compiling.")
@json_option
def chosen(recordings: Path | None, quick: bool, as_json: bool) -> None:
    """Measure `law: auto` on recorded hands: error and chatter, master imposed and with a grip.

    Settings to compare with are chosen on some recordings and judged on the others, over all ways
    of splitting them. Takes ten minutes.

    \b
    Examples:
        python -m tests.lab chosen --quick
        python -m tests.lab chosen --recordings teleop-1dof
    """
    suite = _suite(
        "tests.lab.couplings.chosen", "chosen", recordings=recordings, quick=quick, tell=_tell
    )
    print_suites([suite], as_json)


@lab.command(short_help="Friction and inertia compensation: how much lighter the device feels.")
@click.option("--runs", type=click.IntRange(0), default=1000, show_default=True)
@click.option(
    "--first", type=click.IntRange(0), default=0, show_default=True, help="Seed of the first run."
)
@jobs_option
@keep_option
@json_option
def compensation(runs: int, first: int, jobs: int, keep: Path | None, as_json: bool) -> None:
    """Measure free motion by share of compensated friction and inertia; test it with random runs.

    \b
    Examples:
        python -m tests.lab compensation --runs 10000 --keep runs.jsonl
    """
    suite = _suite(
        "tests.lab.compensation",
        "compensation",
        runs=runs,
        first=first,
        jobs=jobs,
        keep=keep,
        tell=_tell,
    )
    print_suites([suite], as_json)


def _suite(module: str, name: str, **given: Any) -> Suite:
    """Return what a measurement found; its module is loaded now, some of them take seconds."""
    import importlib

    found: Suite = getattr(importlib.import_module(module), name)(**given)
    return found


def _tell(what: str) -> None:
    if sys.stderr.isatty():
        click.echo(f"measuring: {what} ...", err=True)
