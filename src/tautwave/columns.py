"""What a column of a recording is: name, unit, meaning, and where its number comes from.

Who writes a column declares it, beside what fills it: the loop, the controller, a law, a driver, a
simulated axis. Rows, recordings, the reference, exports and reports read the declarations
(`report.columns`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import NamedTuple

PLACES = "AXIS|PAIR|PORT|NODE|JOINT|BUS|WALL|ARM|ELEMENT"
"""Words in the name of a kind that stand for names of the rig."""
ACCOUNT = ("absorbed", "stored", "dissipated")
"""Columns of the energy account that every element of a coupling has [J]."""


class Column(NamedTuple):
    """A kind of column: SIDE is master or slave, AXIS, PAIR and others are names of the rig.

    ARM is a side or, of several arms, a full name such as `master.left`.

    `unit`: of a rotary axis, then of a linear one; after a semicolon that of an admittance axis.
    `value` returns the number to write: of a law `value(s, p)` from state and constants of an axis,
    of a driver `value(owner)` from what it keeps of one; None where the writer fills it itself.
    """

    name: str
    unit: str
    meaning: str
    value: Callable[..., float] | None = None

    def matches(self, column: str) -> bool:
        """Return whether a recorded column is of this kind."""
        return _pattern(self.name).fullmatch(column) is not None

    def unit_on(self, kind: str = "rotary", causality: str = "impedance") -> str:
        """Return its SI unit on an axis of a kind and a causality, "" for counts and states."""
        parts = self.unit.split("; ")
        units = parts[-1 if causality == "admittance" else 0].split(", ")
        unit = units[-1 if kind == "linear" else 0]
        return "" if unit in ("0", "1") else unit


@lru_cache(maxsize=1024)
def _pattern(name: str) -> re.Pattern[str]:
    pattern = re.escape(name).replace("SIDE", "(?:master|slave)")
    return re.compile(re.sub(PLACES, "[A-Za-z_][A-Za-z0-9_.-]*", pattern))


class Kinds:
    """Kinds of columns, from which the one that a recorded column is of is found by its name."""

    def __init__(self, kinds: Iterable[Column]) -> None:
        self._by_end: dict[str, list[Column]] = {}
        for one in kinds:
            end = one.name.rpartition(".")[2]
            self._by_end.setdefault("" if re.search(PLACES, end) else end, []).append(one)

    def of(self, column: str) -> Column | None:
        """Return the kind of a recorded column, the first that matches; None if none does."""
        ends = (column.rpartition(".")[2], "")
        return next(
            (one for end in ends for one in self._by_end.get(end, ()) if one.matches(column)), None
        )


def under(prefix: str, columns: Iterable[Column]) -> tuple[Column, ...]:
    """Return columns as those of one axis or pair are called: `PREFIX.name`."""
    return tuple(one._replace(name=f"{prefix}.{one.name}") for one in columns)


def names(columns: Iterable[Column]) -> list[str]:
    """Return what columns are called."""
    return [one.name for one in columns]
