"""`tautwave bench`: performance of this machine. Available if `tautwave.bench` is installed."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import (
    Number,
    jobs_option,
    json_option,
    keep_option,
    out_option,
    positive,
    recordings_option,
)
from tautwave.cli.terminal.measured import print_suites

QUICK_REALTIME_S = 5.0
QUICK_MEMORY_S = 60.0
HOUR_S = 3600.0

duration_option = click.option(
    "--duration",
    type=float,
    default=10.0,
    show_default=True,
    callback=positive,
    metavar="S",
    help="Duration of the real-time loop [s]; 60 for quotable figures.",
)


@click.group(
    invoke_without_command=True, short_help="Measure loop timing and cost per step on this machine."
)
@json_option
@click.pass_context
def bench(ctx: click.Context, as_json: bool) -> None:
    """Measure loop timing and cost per step on this machine.

    Without a suite, short versions of loop and laws run (under a minute). Times are CPU times
    unless noted otherwise; goals are printed as met or not met, and the exit code is 0 either way.

    \b
    Examples:
        tautwave bench
        tautwave bench loop --duration 60
        tautwave bench loop --hour
        tautwave bench laws --json
    """
    if ctx.invoked_subcommand is not None:
        if as_json:
            raise click.UsageError(
                f"--json belongs after the suite: tautwave bench {ctx.invoked_subcommand} --json"
            )
        return
    backend = _backend()
    suites = [
        backend.loop(duration_s=QUICK_REALTIME_S, memory_s=QUICK_MEMORY_S, rounds=3, tell=_tell),
        backend.laws(rounds=20, tell=_tell),
    ]
    print_suites(suites, as_json)


@bench.command(short_help="Live loop: cycle time, lateness, fake-clock speed, start-up, memory.")
@duration_option
@click.option(
    "--hour",
    is_flag=True,
    help="Track resident memory over a simulated hour; takes minutes. [default: 2 minutes]",
)
@click.option(
    "--rate",
    is_flag=True,
    help="Measure the fastest rate instead: 1, 2 and 6 pairs at 1 to 10 kHz, in Python and "
    "compiled, --duration for each.",
)
@json_option
def loop(duration: float, hour: bool, rate: bool, as_json: bool) -> None:
    """Time the live loop on loopback devices, with the recorder running.

    \b
    Examples:
        tautwave bench loop --duration 60
        tautwave bench loop --rate --duration 10
        tautwave bench loop --hour
    """
    backend = _backend()
    if rate:
        print_suites([backend.rates(duration_s=duration, tell=_tell)], as_json)
        return
    more = {"memory_s": HOUR_S} if hour else {}
    print_suites([backend.loop(duration_s=duration, tell=_tell, **more)], as_json)


@bench.command(short_help="Cost per step of each law, live and compiled.")
@json_option
def laws(as_json: bool) -> None:
    """Measure the cost per step of each law: live and compiled.

    \b
    Example:
        tautwave bench laws --json
    """
    print_suites([_backend().laws(tell=_tell)], as_json)


@bench.command(short_help="Host CPU cost of one exchange on each bus.")
@click.option("--cycles", type=click.IntRange(100), default=2000, show_default=True)
@json_option
def buses(cycles: int, as_json: bool) -> None:
    """Measure the host's cost of one exchange with two axes, for every installed bus.

    \b
    Example:
        tautwave bench buses --json
    """
    print_suites([_backend().buses(cycles=cycles, tell=_tell)], as_json)


@bench.command(short_help="Error against run time of every integrator, and of its peers.")
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
        tautwave bench workprecision --out wp
        tautwave bench workprecision --full --out wp
    """
    suite = _backend().workprecision(full=full, out=out, max_error=max_error, tell=_tell)
    print_suites([suite], as_json)


@bench.command(short_help="Models and whole rigs at numerical extremes.")
@click.option("--full", is_flag=True, help="1e9 steps of the conservative scenes instead of 1e7.")
@out_option("Directory for the tables as CSV; default: none.")
@json_option
def extremes(full: bool, out: Path | None, as_json: bool) -> None:
    """Run stiff and extreme cases: which are refused, which go wrong, and by how much.

    Contacts from 1 to 1e9 N/m on 1 mg to 100 kg with every scheme, whole rigs with one parameter at
    its extremes, and ten million (--full: a billion) steps of lossless scenes.

    \b
    Examples:
        tautwave bench extremes
        tautwave bench extremes --full --out runs/extremes --json
    """
    from tautwave.bench.extremes.suite import write_tables

    suite = _backend().extremes(full=full, tell=_tell)
    if out is not None:
        write_tables(suite, out)
    print_suites([suite], as_json)


@bench.command(short_help="1,000 parameter sets in SIMD lanes against one at a time.")
@json_option
def lanes(as_json: bool) -> None:
    """Measure the speed-up of a sweep that runs 16 parameter sets in SIMD lanes.

    \b
    Example:
        tautwave bench lanes
    """
    print_suites([_backend().lanes(tell=_tell)], as_json)


@bench.command(short_help="The wave port against the one before it and a laboratory's PD.")
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
        tautwave bench port --quick
        tautwave bench port --recordings teleop-1dof --out pictures
        tautwave bench port --hold 3600
    """
    if hold is None:
        suite = _backend().port(**given, tell=_tell)
    elif any(given.values()):
        raise click.UsageError("--hold can be combined with --json only; it measures nothing else")
    else:
        suite = _backend().holding(seconds=hold, tell=_tell)
    print_suites([suite], as_json)


@bench.command(
    short_help="Mass-interaction networks: speed relative to real time, and scaling with size."
)
@json_option
def networks(as_json: bool) -> None:
    """Measure a step of the granular scene, and of chains of 1 to 1e4 masses.

    \b
    Example:
        tautwave bench networks
    """
    print_suites([_backend().networks(tell=_tell)], as_json)


@bench.command(short_help="A pair over random networks: energy, position, force.")
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
        tautwave bench network
        tautwave bench network --patterns 100000 --keep patterns.jsonl
    """
    suite = _backend().network(
        patterns=patterns,
        first=first,
        hour=hour,
        jobs=jobs,
        keep=keep,
        tell=_tell,
    )
    print_suites([suite], as_json)


@bench.command(short_help="Two loops over sealed datagrams, compared with unsealed ones.")
@duration_option
@click.option("--rate", type=Number(50.0, 5000.0), default=1000.0, show_default=True, help="[Hz]")
@json_option
def link(duration: float, rate: float, as_json: bool) -> None:
    """Exchange sealed packets and bare datagrams between two processes: delay, lateness, memory.

    Then run a rig's two sites as `tautwave run --site` does, recorded, for as long again.

    \b
    Examples:
        tautwave bench link --duration 300 --json
    """
    print_suites([_backend().link(duration_s=duration, rate_hz=rate, tell=_tell)], as_json)


@bench.command(short_help="A run with and without bridges, in turns: lateness, CPU.")
@duration_option
@json_option
def view(duration: float, as_json: bool) -> None:
    """Run a rig with its bridges alternately open and closed, and compare its lateness.

    The bridges are the page, Foxglove and ROS 2, if installed, each with a client if it needs one,
    and a program that polls rows.

    \b
    Examples:
        tautwave bench view --duration 60
    """
    print_suites([_backend().view(duration_s=duration, tell=_tell)], as_json)


@bench.command(short_help="Every coupling, with and without an account: tracking, calm, energy.")
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
        tautwave bench couplings --rigs 200
        tautwave bench couplings --rigs 10000 --keep rigs.jsonl
        tautwave bench couplings --frontier --recordings teleop-1dof --out pictures
        tautwave bench couplings --delays
    """
    if delays:
        suite = _backend().long_delays(tell=_tell)
    elif frontier:
        suite = _backend().frontier_suite(recordings=recordings, quick=quick, out=out, tell=_tell)
    else:
        suite = _backend().couplings(
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


@bench.command(short_help="Friction and inertia compensation: how much lighter the device feels.")
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
        tautwave bench compensation --runs 10000 --keep runs.jsonl
    """
    suite = _backend().compensation(runs=runs, first=first, jobs=jobs, keep=keep, tell=_tell)
    print_suites([suite], as_json)


def _backend() -> Any:
    return importlib.import_module("tautwave.bench")


def _tell(what: str) -> None:
    if sys.stderr.isatty():
        click.echo(f"measuring: {what} ...", err=True)
