"""`tautwave report`: the page of a run again, or two runs side by side."""

from __future__ import annotations

from pathlib import Path

import click

from tautwave.cli.options import PATH
from tautwave.errors import RecordingError


@click.command(short_help="Rebuild the report of a run, or compare two.")
@click.argument("directory", type=PATH, metavar="DIR")
@click.argument("other", type=PATH, metavar="[DIR2]", required=False)
@click.option(
    "--out",
    type=PATH,
    metavar="DIR",
    help="Where the comparison goes; default: compare-DIR-DIR2 beside DIR2.",
)
def report(directory: Path, other: Path | None, out: Path | None) -> None:
    """Rebuild the report of the run in DIR, or compare it with the one in DIR2.

    Works from the recording, also where the run was killed before it could write its summary.

    \b
    Examples:
        tautwave report runs/first
        tautwave report runs/first runs/second --out runs/first-against-second
    """
    for run in (directory, other):
        if run is not None and not run.is_dir():
            raise RecordingError(f"{run}: there is no such directory; give the --out of a run")
    if other is None:
        if out is not None:
            raise click.UsageError("--out belongs to a comparison; give two directories.")
        from tautwave.report import write_report

        click.echo(write_report(directory))
        return

    from tautwave.report import compare_reports

    names = f"compare-{directory.resolve().name}-{other.resolve().name}"
    click.echo(compare_reports(directory, other, out or other.resolve().parent / names))
