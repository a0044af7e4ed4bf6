"""`tautwave drivers`: the plugins that are installed, and what each still needs."""

from __future__ import annotations

import click

from tautwave.cli.options import echo_json, json_option
from tautwave.cli.show import BAD, Cell, Section, show


@click.command(short_help="List the installed bus drivers.")
@json_option
def drivers(as_json: bool) -> None:
    """List the installed bus drivers, and the extras that are missing.

    \b
    Examples:
        tautwave drivers
        tautwave drivers --json
    """
    from tautwave import registry

    found = registry.list_drivers()
    if as_json:
        echo_json([entry._asdict() for entry in found])
        return
    rows = [
        (
            entry.name,
            f"{entry.package} {entry.version}",
            entry.summary,
            Cell(", ".join(entry.missing), BAD) if entry.missing else "",
        )
        for entry in found
    ]
    show([Section("Drivers", ("name", "package", "what it is", "missing"), rows)])
