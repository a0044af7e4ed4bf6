"""`tautwave view`: look at a run in progress, from another terminal or a browser."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tautwave.cli.options import PATH, echo_json, run_argument, wait_option

LOOK_NS = 200_000_000
PATIENCE_NS = 5_000_000_000
"""A run that is only beginning has no rows yet."""


@click.command(short_help="Watch a run in progress, in the terminal or as a web page.")
@run_argument
@click.option("--once", is_flag=True, help="Show the newest row and exit.")
@click.option(
    "--json",
    "as_json",
    is_flag=True,
    help="Print the newest row as JSON, with all columns, and exit.",
)
@click.option("--page", is_flag=True, help="Serve a page: curves, states, buttons, tuning.")
@click.option("--address", default="127.0.0.1", show_default=True, help="Where it is served.")
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    help="Port of the page; 0, the default: any free port.",
)
@click.option(
    "--tls-cert",
    type=PATH,
    metavar="FILE",
    help="TLS certificate; required if other machines can reach the page.",
)
@click.option("--tls-key", type=PATH, metavar="FILE", help="Private key of that certificate.")
@click.option("--foxglove", is_flag=True, help="Serve the page and the Foxglove protocol.")
@click.option(
    "--foxglove-origin",
    multiple=True,
    metavar="URL",
    help="Allowed web origin of Foxglove or Lichtblick; may be repeated.",
)
@wait_option
def view(
    directory: Path,
    once: bool,
    as_json: bool,
    page: bool,
    address: str,
    port: int,
    tls_cert: Path | None,
    tls_key: Path | None,
    foxglove: bool,
    foxglove_origin: tuple[str, ...],
    wait: float,
) -> None:
    """Show the run in DIR while it runs: one line per pair, and the loop's health.

    Reads the run's shared memory without writing to it: a slow, stopped or killed viewer does not
    affect the run. Ctrl-C ends the viewer, not the run.

    With --page it serves a web page on this machine and prints its address. Anyone with the full
    address, which ends in a token, can command the rig; without the token one can only view and
    stop it.

    \b
    Examples:
        tautwave view runs/shift
        tautwave view runs/shift --json
        tautwave view runs/shift --page
        tautwave view runs/shift --foxglove
    """
    if page or foxglove:
        from tautwave.cli.terminal.serve_page import serve_page

        origins = foxglove_origin if foxglove else None
        serve_page(directory, address, port, tls_cert, tls_key, wait, origins)
        return
    from tautwave.cli.terminal.live import Health, live_lines, news_lines, room, watch_health
    from tautwave.clock import MonotonicClock
    from tautwave.errors import RecordingError
    from tautwave.runtime.tap import Tap
    from tautwave.view.watched import read_live

    live = read_live(directory)
    tap = Tap.of_run(live)
    health, shown = Health(), 0
    newest: list[float] = []
    clock = MonotonicClock()
    patience = clock.now_ns() + PATIENCE_NS
    writer = Path(f"/proc/{live.pid}")
    while writer.exists() and not tap.closed:
        rows = tap.take()
        health = watch_health(rows, live, health)
        newest = rows[-1] if rows else newest
        if not newest and clock.now_ns() > patience:
            raise RecordingError(
                f"{directory}: no rows arrive; is the run still opening its buses?"
            )
        if newest and as_json:
            echo_json(dict(zip(live.columns, newest, strict=True)))
            return
        if newest:
            columns, most = room(sys.stdout.fileno()) if sys.stdout.isatty() else (80, 1_000)
            lines = [
                *live_lines(newest, live, health, tap.missed),
                *news_lines(tap.news(), columns),
            ]
            lines = [line[:columns] for line in lines[:most]]
            if shown and sys.stdout.isatty():
                click.echo(f"\x1b[{shown}A\x1b[J", nl=False)
            if not shown or sys.stdout.isatty() or once:
                click.echo("\n".join(lines))
            shown = len(lines)
            if once:
                return
        clock.sleep_until(clock.now_ns() + LOOK_NS)
    click.echo(
        f"{directory}: the run has ended; run `tautwave report {directory}` to write its report"
    )
