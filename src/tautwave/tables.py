"""A table for people, apart from where it is read.

`cli.terminal.show` prints it on a terminal and as plain text, `report.html` puts it on a page.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, NamedTuple

Level = Literal["", "ok", "note", "bad", "faint"]
"""How serious a text is, as the severities of a summary; `faint`: less important than others."""

GOOD: Level = "ok"
NOTE: Level = "note"
BAD: Level = "bad"
FAINT: Level = "faint"


class Cell(NamedTuple):
    """Text of a level. Use sparingly: most text is a plain str."""

    text: str
    level: Level


class Table(NamedTuple):
    """A titled table.

    A column whose name begins with '>' is right-aligned. `note` stands below, `level` is that of
    the title.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str | Cell]]
    note: str = ""
    level: Level = ""


def text_of(cell: str | Cell) -> str:
    """Return what a cell says."""
    return cell.text if isinstance(cell, Cell) else cell


def titled(columns: Sequence[str]) -> list[str]:
    """Return the names of columns without their alignment."""
    return [name.removeprefix(">") for name in columns]


def of_numbers(*names: str) -> tuple[str, ...]:
    """Return columns: the first is text, the others are numbers and right-aligned."""
    return (*names[:1], *(f">{name}" for name in names[1:]))
