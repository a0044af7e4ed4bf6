"""`tautwave drivers`: the installed plugins and parts, and what each still needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from tautwave.cli.options import echo_json, json_option
from tautwave.cli.terminal.show import show
from tautwave.tables import BAD, Cell, Table

if TYPE_CHECKING:
    from tautwave.registry import Installed

PARTS = ("coupling", "control", "environment", "hand")


@click.command(short_help="List the installed drivers and parts.")
@json_option
def drivers(as_json: bool) -> None:
    """List the installed drivers, couplings, controls, environments, hands, and what is missing.

    A control stands between the axes in place of a coupling, such as a scene.

    \b
    Examples:
        tautwave drivers
        tautwave drivers --json
    """
    from tautwave import registry

    installed = {"driver": registry.list_drivers()}
    installed |= {group: registry.list_parts(f"tautwave.{group}s") for group in PARTS}
    if as_json:
        echo_json(
            [
                {"kind": kind, **entry._asdict()}
                for kind, rows in installed.items()
                for entry in rows
            ]
        )
        return
    headings = ("name", "package", "description", "missing")
    show(
        [
            Table(f"{kind.capitalize()}s", headings, [_row(entry) for entry in rows])
            for kind, rows in installed.items()
            if rows
        ]
    )


def _row(entry: Installed) -> tuple[str | Cell, ...]:
    return (
        entry.name,
        f"{entry.package} {entry.version}",
        entry.summary,
        Cell(", ".join(entry.missing), BAD) if entry.missing else "",
    )
