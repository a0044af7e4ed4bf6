"""Tables for people: rich on a terminal, plain aligned text everywhere else."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import click

from tautwave.cli.terminal.streams import escaped, suppress_output_errors

GOOD, BAD, NOTE, FAINT = "green", "bold red", "yellow", "dim"


def printable(text: str, most: int = 1000) -> str:
    """Return what others wrote, such as a name, without what a terminal would obey, and cut."""
    shown = "".join(one if one.isprintable() else "?" for one in text[: most + 1])
    return shown if len(shown) <= most else f"{shown[: most - 3]}..."


class Cell(NamedTuple):
    """Text with a colour. Use sparingly: most text is a plain str."""

    text: str
    style: str


class Section(NamedTuple):
    """A titled table. A column whose name begins with '>' is right-aligned."""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    style: str = "bold"


def show(sections: Sequence[Section]) -> None:
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


def plain_lines(section: Section) -> Iterator[str]:
    """`section` as aligned text, with our own text in ASCII."""
    if section.title:
        yield plain(escaped(section.title))
    rows = [[plain(_text(cell)) for cell in row] for row in section.rows]
    headers = [name.lstrip(">") for name in section.columns]
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


def plain_text(sections: Sequence[Section]) -> str:
    """Return the non-empty sections as plain text, as `show` prints them."""
    parts = [list(plain_lines(section)) for section in _filled(sections)]
    return "\n\n".join("\n".join(lines) for lines in parts) + "\n"


def _filled(sections: Sequence[Section]) -> list[Section]:
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
    return escaped(cell.text if isinstance(cell, Cell) else cell)


def _show_rich(sections: Sequence[Section]) -> None:
    from rich.console import Console
    from rich.padding import Padding
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    for section in sections:
        if section.title:
            console.print(Text(escaped(section.title), style=section.style))
        if not section.rows:
            continue
        named = any(name.strip(">") for name in section.columns)
        table = Table(box=None, show_header=named, header_style=FAINT, padding=(0, 2, 0, 0))
        for name in section.columns:
            right = name.startswith(">")
            table.add_column(
                name.lstrip(">"), justify="right" if right else "left", overflow="fold"
            )
        for row in section.rows:
            table.add_row(
                *(Text(_text(c), style=c.style if isinstance(c, Cell) else "") for c in row)
            )
        console.print(Padding(table, (0, 0, 1, 2)))


def verdict(passed: bool | None, state: str | None = None) -> Cell:
    """The verdicts of a certificate; one that was not evaluated is never called passed."""
    if passed is None:
        return Cell("not yet evaluated", NOTE)
    if passed and state == "conditional":
        return Cell("conditional", NOTE)
    return Cell("passed", GOOD) if passed else Cell("not passed", BAD)
