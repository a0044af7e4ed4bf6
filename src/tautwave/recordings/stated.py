"""What is stated about a recording's file because the file does not say it."""

from __future__ import annotations

from typing import NamedTuple


class Stated(NamedTuple):
    """How a file is to be read where it does not say so itself.

    `time_unit` is a key of `recordings.times.UNITS`; None: from the column's name and values.
    `rate_hz` is that of rows without a time, `columns` are the names of a text file's columns
    without a heading, `episode` is that of a dataset with several.
    """

    time_unit: str | None = None
    rate_hz: float | None = None
    columns: tuple[str, ...] = ()
    episode: int | None = None


UNSTATED = Stated()


def stated_in(keys: object) -> Stated:
    """Return what an object's attributes of the same names state, such as a block of a rig."""
    unit, rate, columns, episode = (getattr(keys, name, None) for name in Stated._fields)
    return Stated(unit, rate, tuple(columns or ()), episode)
