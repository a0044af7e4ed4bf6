"""`tautwave bench`: performance of this machine. Available if `tautwave.bench` is installed."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import (
    PATH,
    Number,
    Whole,
    json_option,
    out_option,
    positive,
    set_option,
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
@click.option("--cycles", type=Whole(100), default=2000, show_default=True)
@json_option
def buses(cycles: int, as_json: bool) -> None:
    """Measure the host's cost of one exchange with two axes, for every installed bus.

    \b
    Example:
        tautwave bench buses --json
    """
    print_suites([_backend().buses(cycles=cycles, tell=_tell)], as_json)


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


@bench.command(short_help="Error against run time: your rig or scene, by every scheme and step.")
@click.argument("rig", type=PATH, required=False)
@set_option
@click.option("--full", is_flag=True, help="More steps over more decades; takes minutes.")
@click.option(
    "--begin",
    type=Number(0.0),
    default=0.0,
    show_default=True,
    help="Of a scene: where the fifth of a second that is compared begins [s].",
)
@click.option(
    "--max-error",
    type=float,
    default=1e-4,
    show_default=True,
    callback=positive,
    help="Error bound for the chosen point, as a share of the travel.",
)
@out_option("Directory for CSV, JSON and pictures; default: none.")
@json_option
def workprecision(
    rig: Path | None,
    overrides: tuple[str, ...],
    full: bool,
    begin: float,
    max_error: float,
    out: Path | None,
    as_json: bool,
) -> None:
    """Measure error against run time of a simulated RIG: every scheme, steps over decades.

    Shows what a smaller error costs, which points nothing beats, and what `integrator: {scheme:
    auto}` takes. Without RIG: the rig of the README.

    \b
    Examples:
        tautwave bench workprecision
        tautwave bench workprecision my-rig.yaml --out wp
        tautwave bench workprecision scene-drum.yaml --begin 0.13
    """
    from tautwave.bench.precision.suite import workprecision as measure

    suite = measure(
        _rig_or_shipped(rig),
        changes=overrides,
        full=full,
        begin_s=begin,
        out=out,
        max_error=max_error,
        tell=_tell,
    )
    print_suites([suite], as_json)


@bench.command(short_help="Numerical stability: your rig or scene with each parameter at its ends.")
@click.argument("rig", type=PATH, required=False)
@set_option
@click.option(
    "--duration",
    type=Number(0.01, 3600.0),
    default=9.0,
    show_default=True,
    help="Simulated time of each case at most [s]; 20,000 cycles at most.",
)
@out_option("Directory for the tables as CSV; default: none.")
@json_option
def extremes(
    rig: Path | None, overrides: tuple[str, ...], duration: float, out: Path | None, as_json: bool
) -> None:
    """Simulate RIG stiff, light, heavy, slow, fast and saturated: which cases end how, and why.

    Each parameter that the rig has goes to the ends of its range, e.g. stiffness from 1 to 1e9.
    Every number of every row has to be finite; the residual of the energy books and what was
    generated stand beside it. Without RIG: the rig of the README.

    \b
    Examples:
        tautwave bench extremes
        tautwave bench extremes my-rig.yaml --duration 2
    """
    from tautwave.bench.extremes import extremes as measure
    from tautwave.bench.result import write_tables

    suite = measure(_rig_or_shipped(rig), changes=overrides, duration_s=duration, tell=_tell)
    if out is not None:
        write_tables(suite, out)
    print_suites([suite], as_json)


def _rig_or_shipped(rig: Path | None) -> Path:
    """Return the path of a rig; without one that of the README's."""
    if rig is not None:
        return rig
    from tautwave.bench.rigs import ONE_PAIR

    return ONE_PAIR.path()


def _backend() -> Any:
    return importlib.import_module("tautwave.bench")


def _tell(what: str) -> None:
    if sys.stderr.isatty():
        click.echo(f"measuring: {what} ...", err=True)
