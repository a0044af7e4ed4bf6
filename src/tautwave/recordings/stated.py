"""What is stated about a recording's file because the file does not say it."""

from __future__ import annotations

from typing import NamedTuple


class Stated(NamedTuple):
    """How a file is to be read where it does not say so itself.

    `time_unit` is a key of `recordings.times.UNITS`; None: told from the column's name and values.
    """

    time_unit: str | None = None


def stated_in(keys: object) -> Stated:
    """Return what an object's attributes of the same names state, such as a block of a rig."""
    return Stated(getattr(keys, "time_unit", None))
