"""`tautwave bench`: performance of this machine. Available if `tautwave.bench` is installed."""

from __future__ import annotations

import importlib
import sys
import textwrap
from pathlib import Path
from typing import Any

import click

from tautwave.cli.options import echo_json, json_option, out_option, positive
from tautwave.cli.terminal.show import BAD, GOOD, NOTE, Cell, Section, show

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

    Without a suite, loop and laws run in their short form (below a minute). Times are CPU times
    unless a table says otherwise; goals are printed as met or not met, the exit code is 0 either
    way.

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
    _print(suites, as_json)


@bench.command(short_help="Live loop: cycle time, lateness, fake-clock speed, start-up, memory.")
@duration_option
@click.option(
    "--hour",
    is_flag=True,
    help="Watch the resident size over a simulated hour; takes minutes. [default: 2 minutes]",
)
@click.option(
    "--rate",
    is_flag=True,
    help="Measure the fastest rate instead: 1, 2 and 6 pairs at 1 to 10 kHz, in Python and "
    "compiled, "
    "--duration for each.",
)
@json_option
def loop(duration: float, hour: bool, rate: bool, as_json: bool) -> None:
    """Run the live loop on loopback devices, recorder running, and time it.

    \b
    Examples:
        tautwave bench loop --duration 60
        tautwave bench loop --rate --duration 10
        tautwave bench loop --hour
    """
    backend = _backend()
    if rate:
        _print([backend.rates(duration_s=duration, tell=_tell)], as_json)
        return
    more = {"memory_s": HOUR_S} if hour else {}
    _print([backend.loop(duration_s=duration, tell=_tell, **more)], as_json)


@bench.command(short_help="Cost per step of each law, live and compiled.")
@json_option
def laws(as_json: bool) -> None:
    """Measure the cost per step of each law: live and compiled.

    \b
    Example:
        tautwave bench laws --json
    """
    _print([_backend().laws(tell=_tell)], as_json)


@bench.command(short_help="Host CPU cost of one exchange on each bus.")
@click.option("--cycles", type=click.IntRange(100), default=2000, show_default=True)
@json_option
def buses(cycles: int, as_json: bool) -> None:
    """Measure what one exchange of two axes costs the host, on every installed bus.

    \b
    Example:
        tautwave bench buses --json
    """
    _print([_backend().buses(cycles=cycles, tell=_tell)], as_json)


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
    _print([suite], as_json)


@bench.command(short_help="Models and whole rigs at numerical extremes.")
@click.option("--full", is_flag=True, help="1e9 steps of the conservative scenes instead of 1e7.")
@out_option("Directory for the tables as CSV; default: none.")
@json_option
def extremes(full: bool, out: Path | None, as_json: bool) -> None:
    """Run stiff and extreme cases: what is refused, what goes wrong, by how much.

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
    _print([suite], as_json)


@bench.command(short_help="1,000 parameter sets in SIMD lanes against one at a time.")
@json_option
def lanes(as_json: bool) -> None:
    """Measure the gain of a sweep that runs 16 parameter sets in SIMD lanes.

    \b
    Example:
        tautwave bench lanes
    """
    _print([_backend().lanes(tell=_tell)], as_json)


@bench.command(short_help="The wave port against the one before it and a laboratory's PD.")
@click.option(
    "--recordings",
    type=click.Path(file_okay=False, exists=True, path_type=Path),
    help="Folder of recorded hands, <set>_<free_motion|foam|spring|rigid>.csv; without it hands "
    "are multisines.",
)
@click.option("--quick", is_flag=True, help="One hand per contact, 10 s of holding.")
@click.option("--cost", is_flag=True, help="Measure CPU time too; numba compiles for a minute.")
@out_option("Directory for the picture of a held force; default: none.")
@json_option
def port(recordings: Path | None, quick: bool, cost: bool, out: Path | None, as_json: bool) -> None:
    """Compare tracking, holding and cost of the wave port: before, after, lab.

    On the identified bench at 2 kHz, in one simulator. Before is the port with an account and a
    velocity filter, lab a position-position PD. Takes minutes.

    \b
    Examples:
        tautwave bench port --quick
        tautwave bench port --recordings teleop-1dof --out pictures
    """
    suite = _backend().port(recordings=recordings, quick=quick, cost=cost, out=out, tell=_tell)
    _print([suite], as_json)


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
    _print([_backend().networks(tell=_tell)], as_json)


@bench.command(short_help="A pair over random networks: energy, position, force.")
@click.option("--patterns", type=click.IntRange(1), default=1000, show_default=True)
@click.option(
    "--first", type=click.IntRange(0), default=0, show_default=True, help="Seed of the first one."
)
@click.option("--hour", is_flag=True, help="Move a pair for an hour, too: half a minute more.")
@json_option
def network(patterns: int, first: int, hour: bool, as_json: bool) -> None:
    """Run a pair over random networks with our receiver, and with those in common use.

    Counts where more energy came out of a receiver than went into the far end: 0 for ours, to the
    bit. Then chosen networks (jitter, loss, bursts, an outage) side by side, and a force held for
    a minute on two clocks. Two minutes for each 1,000 patterns.

    \b
    Examples:
        tautwave bench network
        tautwave bench network --patterns 100000 --json
        tautwave bench network --patterns 1 --hour
    """
    _print([_backend().network(patterns=patterns, first=first, hour=hour, tell=_tell)], as_json)


def _backend() -> Any:
    return importlib.import_module("tautwave.bench")


def _tell(what: str) -> None:
    if sys.stderr.isatty():
        click.echo(f"measuring: {what} ...", err=True)


def _print(suites: list[Any], as_json: bool) -> None:
    results = [suite.as_dict() for suite in suites]
    if as_json:
        echo_json(results[0] if len(results) == 1 else {"suites": results})
        return
    for number, result in enumerate(results):
        if number == 0:
            click.echo(", ".join(f"{key} {value}" for key, value in result["machine"].items()))
        for table in result["tables"]:
            click.echo()
            _print_table(table)
    click.echo()
    show([_goal_section([goal for result in results for goal in result["goals"]])])


def _print_table(table: dict[str, Any]) -> None:
    rows = table["rows"]
    columns = list(rows[0]) if rows else []
    heads = [name if at == 0 else f">{heading(name)}" for at, name in enumerate(columns)]
    cells = [[figure(row[name]) for name in columns] for row in rows]
    show([Section(table["title"], heads, cells)])
    click.echo(textwrap.indent(textwrap.fill(table["what"], 96), "  "))


def _goal_section(goals: list[dict[str, Any]]) -> Section:
    rows: list[list[str | Cell]] = []
    for goal in goals:
        relation = ">=" if goal["at_least"] else "<="
        verdict = {True: Cell("met", GOOD), False: Cell("not met", BAD)}.get(
            goal["met"], Cell(goal["why_not"] or "not measured", NOTE)
        )
        measured = "measured " + figure(goal["measured"])
        rows.append(
            [f"{goal['name']} {relation} {goal['limit']:g} {goal['unit']}:", measured, verdict]
        )
    return Section("Goals", ("", "", ""), rows)


def heading(column: str) -> str:
    """Return a column's name with its unit in brackets: `p50_us` is `p50 [us]`."""
    name, _, unit = column.rpartition("_")
    per = {"mb_per_h": "MB/h"}
    for suffix, text in per.items():
        if column.endswith("_" + suffix):
            return f"{column.removesuffix('_' + suffix).replace('_', ' ')} [{text}]"
    if name and unit in ("ns", "us", "s", "mb"):
        return f"{name.replace('_', ' ')} [{unit.replace('mb', 'MB')}]"
    return column.replace("_", " ")


def figure(value: Any) -> str:
    """Return a measured number with its significant digits: three, or all before the point."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    if abs(value) >= 100.0:
        return f"{value:.0f}"
    return f"{value:.3g}"
