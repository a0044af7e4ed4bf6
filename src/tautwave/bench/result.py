"""Result of a suite of measurements: tables with descriptions, and goals."""

from __future__ import annotations

import csv
import io
import math
import os
import platform
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.files import make_directory, write_text

Value = float | int | str | None


class Table(NamedTuple):
    """Rows of numbers under named columns; `what` says what was measured and how."""

    title: str
    what: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Value]]


class Goal(NamedTuple):
    """A figure to reach. `measured` is None where it could not be measured, `why_not` says why."""

    name: str
    limit: float
    unit: str
    measured: float | None
    at_least: bool = False
    why_not: str = ""

    @property
    def met(self) -> bool | None:
        """Whether the goal is reached; None while it is not measured."""
        if self.measured is None or math.isnan(self.measured):
            return None
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit


class Suite(NamedTuple):
    """Everything one call of `tautwave bench` measured."""

    name: str
    tables: Sequence[Table]
    goals: Sequence[Goal]

    def as_dict(self) -> dict[str, Any]:
        """Return all numbers as plain data for JSON."""
        return {
            "bench": self.name,
            "machine": machine(),
            "tables": [
                {
                    "title": table.title,
                    "what": table.what,
                    "rows": [dict(zip(table.columns, row, strict=True)) for row in table.rows],
                }
                for table in self.tables
            ],
            "goals": [{**goal._asdict(), "met": goal.met} for goal in self.goals],
        }


def machine() -> Mapping[str, Value]:
    """Return what the figures depend on: processor, cores, load, interpreter."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "load_average": round(os.getloadavg()[0], 2),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def _processor() -> str:
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor()
    for line in text.splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.processor()


def write_tables(suite: Suite, out: Path) -> list[Path]:
    """Write every table as CSV into a directory; return the files.

    Raises
    ------
    WritingError
        The directory cannot be written.
    """
    make_directory(out)
    return [_write(table, out / f"{_stem(suite.name, table.title)}.csv") for table in suite.tables]


def _stem(name: str, title: str) -> str:
    return f"{name}-" + title.lower().replace(" ", "-")


def _write(table: Table, path: Path) -> Path:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(table.rows)
    write_text(path, text.getvalue())
    return path


class Group(NamedTuple):
    """Rigs that differ in one thing; each has its overrides."""

    name: str
    rigs: tuple[tuple[str, ...], ...]
