"""`tautwave example`: the rig files that come with tautwave, listed and copied."""

from __future__ import annotations

from pathlib import Path

import click

from tautwave.cli.options import echo_json, json_option, out_option
from tautwave.cli.terminal.show import show
from tautwave.tables import Table


@click.command(short_help="List the shipped rig files, or copy one.")
@click.argument("name", required=False)
@out_option("Copy into DIR, which is created if needed; default: the current directory.")
@json_option
def example(name: str | None, out: Path | None, as_json: bool) -> None:
    """List the rig files shipped with tautwave, or copy the one called NAME.

    A sweep includes its rig, a scene its sounds. Existing files are never overwritten.

    \b
    Examples:
        tautwave example
        tautwave example bench-1dof-loopback
        tautwave example sweeps/delay-stability --out study
    """
    from tautwave.config import shipped

    if name is None:
        if out is not None:
            raise click.UsageError("--out needs the NAME of an example.")
        examples = shipped.examples()
        if as_json:
            echo_json([{"name": entry.name, "summary": entry.summary} for entry in examples])
        else:
            rows = [(entry.name, entry.summary) for entry in examples]
            show([Table("Examples", ("name", "what it shows"), rows)])
        return
    copied = shipped.copy_example(name, Path() if out is None else out)
    if as_json:
        echo_json([{"path": str(file.path), "written": file.written} for file in copied])
        return
    for file in copied:
        click.echo(f"{file.path}" if file.written else f"{file.path}: there already, unchanged")
