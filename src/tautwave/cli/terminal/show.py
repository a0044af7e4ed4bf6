"""Tables for people: rich on a terminal, plain aligned text everywhere else."""

from __future__ import annotations

import re
import sys
import textwrap
from collections.abc import Iterator, Sequence

import click

from tautwave.cli.terminal.streams import escaped, suppress_output_errors
from tautwave.tables import BAD, FAINT, GOOD, NOTE, Cell, Level, Table, text_of, titled

STYLES: dict[Level, str] = {
    "": "",
    "ok": "green",
    "note": "yellow",
    "bad": "bold red",
    "faint": "dim",
}
WIDE = 96
"""Columns of a note below a table."""


def printable(text: str, most: int = 1000) -> str:
    """Return what others wrote, such as a name, without what a terminal would obey, and cut."""
    shown = "".join(one if one.isprintable() else "?" for one in text[: most + 1])
    return shown if len(shown) <= most else f"{shown[: most - 3]}..."


def show(sections: Sequence[Table]) -> None:
    """Print the non-empty sections on stdout; the first one is the headline."""
    filled = _filled(sections)
    with suppress_output_errors(sys.stdout, BrokenPipeError):
        if sys.stdout.isatty():
            _show_rich(filled)
            return
        for number, section in enumerate(filled):
            if number:
                click.echo()
            for line in plain_lines(section):
                click.echo(line)


def plain_lines(section: Table) -> Iterator[str]:
    """`section` as aligned text, with our own text in ASCII."""
    if section.title:
        yield plain(escaped(section.title))
    rows = [[plain(_text(cell)) for cell in row] for row in section.rows]
    headers = titled(section.columns)
    if any(headers):
        rows.insert(0, headers)
    rows = [line for row in rows for line in _lines(row)]
    widths = [max((len(row[at]) for row in rows), default=0) for at in range(len(headers))]
    for row in rows:
        cells = [
            text.rjust(width) if name.startswith(">") else text.ljust(width)
            for text, width, name in zip(row, widths, section.columns, strict=True)
        ]
        yield ("  " + "  ".join(cells)).rstrip()
    yield from _note(section)


def plain_text(sections: Sequence[Table]) -> str:
    """Return the non-empty sections as plain text, as `show` prints them."""
    parts = [list(plain_lines(section)) for section in _filled(sections)]
    return "\n\n".join("\n".join(lines) for lines in parts) + "\n"


def _note(section: Table) -> list[str]:
    return textwrap.indent(textwrap.fill(escaped(section.note), WIDE), "  ").splitlines()


def _filled(sections: Sequence[Table]) -> list[Table]:
    return [section for at, section in enumerate(sections) if section.rows or at == 0]


def _lines(row: Sequence[str]) -> Iterator[list[str]]:
    """Yield a row line by line if a cell has several lines."""
    cells = [cell.split("\n") for cell in row]
    for at in range(max(len(cell) for cell in cells)):
        yield [cell[at] if at < len(cell) else "" for cell in cells]


_THIN = "\N{NARROW NO-BREAK SPACE}"
_ASCII = {_THIN: " ", "\N{MINUS SIGN}": "-", "\N{MICRO SIGN}": "u"}
_POWER = re.compile(f"{_THIN}?×{_THIN}?10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)")
_DIGITS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def plain(text: str) -> str:
    """Convert typeset numbers to machine-readable ones: `2.1e-14`, `12 us`."""
    text = _POWER.sub(lambda power: "e" + power[1].translate(_DIGITS), text)
    for mark, sign in _ASCII.items():
        text = text.replace(mark, sign)
    return text


def _text(cell: str | Cell) -> str:
    return escaped(text_of(cell))


def _style(cell: str | Cell) -> str:
    return STYLES[cell.level] if isinstance(cell, Cell) else ""


def _show_rich(sections: Sequence[Table]) -> None:
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table as Printed
    from rich.text import Text

    console = Console(highlight=False)
    for section in sections:
        if section.title:
            console.print(Text(escaped(section.title), style=f"bold {STYLES[section.level]}"))
        if not section.rows:
            continue
        named = any(name.strip(">") for name in section.columns)
        table = Printed(
            box=None, show_header=named, header_style=STYLES[FAINT], padding=(0, 2, 0, 0)
        )
        for name in section.columns:
            right = name.startswith(">")
            table.add_column(
                name.removeprefix(">"), justify="right" if right else "left", overflow="fold"
            )
        for row in section.rows:
            table.add_row(*(Text(_text(cell), style=_style(cell)) for cell in row))
        console.print(Padding(table, (0, 0, 1, 2)))
        for line in _note(section):
            console.print(Text(line))


def verdict(passed: bool | None, state: str | None = None) -> Cell:
    """The verdicts of a certificate; one that was not evaluated is never called passed."""
    if passed is None:
        return Cell("not yet evaluated", NOTE)
    if passed and state == "conditional":
        return Cell("conditional", NOTE)
    return Cell("passed", GOOD) if passed else Cell("not passed", BAD)
