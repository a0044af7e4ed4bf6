"""The unit of a recording's times: stated, from the column's name or a date, or refused."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tautwave.errors import ConfigError

Array = NDArray[np.float64]

UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds of each unit of time that a recording may have."""
WORDS = {"s": "seconds", "ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}
DATES_S = (5e8, 5e9)
"""[s] Since 1970: from 1985 to 2128, where the units' numbers do not overlap."""
LONGEST_STEP_S = 0.2
"""[s] Typical step of what was recorded in seconds; a slower recording states its unit."""

_TIMES = ("time", "t", "timestamp", "stamp", "time_sec", "seconds", "header_stamp", "elapsed")
_NAMED = {
    "s": r"s|sec|secs|seconds",
    "ms": r"ms|msec|millis|milliseconds",
    "us": r"us|usec|micros|microseconds",
    "ns": r"ns|nsec|nanos|nanoseconds|nanosec",
}


def plain(name: str) -> str:
    """Return a column's name in lower case, with an underscore for each run of other characters."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower().replace("µ", "u").replace("μ", "u")).strip("_")


def time_columns(names: Sequence[str]) -> list[str]:
    """Return which of the columns are named as times: `t`, `Time [s]`, `log.t`, `stamp_ms`."""
    if "time_s" in names:
        return ["time_s"]
    return [name for name in names if _is_time(plain(name)) or _is_time(plain(_leaf(name)))]


def _leaf(name: str) -> str:
    return name.rpartition(".")[2]


def _is_time(word: str) -> bool:
    stem = word.rpartition("_")[0] if named_unit(word) is not None else word
    return word in _TIMES or stem in _TIMES


def named_unit(name: str) -> str | None:
    """Return the unit that the last word of a column's name is: `ms` of `stamp_ms`, `t [ms]`."""
    last = plain(name).rpartition("_")[2]
    for unit, words in _NAMED.items():
        if re.fullmatch(words, last):
            return unit
    return None


def unit_of_times(path: Path, column: str, times: Array, stated: str | None) -> tuple[str, str]:
    """Return the unit of the times of a recording, and how it is known: '' where they are seconds.

    A unit that is stated holds. Else that of a date between 1985 and 2128, of which the numbers
    are like no other unit's; else that of the column's name, where the steps may be of it.

    Parameters
    ----------
    path, column
        For the message.
    times : array, (n,)
        As they are in the file; n >= 2.
    stated : str, optional
        A key of `UNITS`.

    Raises
    ------
    ConfigError
        The unit is not known, or the date contradicts the name: with the likely factor.
    """
    if stated is not None:
        return stated, "as stated" if stated != "s" else ""
    step = float(np.median(np.diff(times)))
    dated = next(
        (u for u, f in UNITS.items() if DATES_S[0] <= abs(float(times[0])) * f <= DATES_S[1]), None
    )
    named = named_unit(column)
    if named is not None and dated is not None and named != dated:
        raise ConfigError(
            f"{path}: {column!r} is in {WORDS[named]} by its name and, by its date, in "
            f"{WORDS[dated]}; {_state(dated)}"
        )
    if dated is not None and step * UNITS[dated] <= LONGEST_STEP_S:
        return dated, "by their date" if dated != "s" else ""
    if named is not None and step * UNITS[named] <= LONGEST_STEP_S:
        return named, "by the column's name" if named != "s" else ""
    if named is None and dated is None and step <= LONGEST_STEP_S:
        return "s", ""
    # The coarsest unit in which there are ten rows a second or more.
    likely = next((unit for unit, f in UNITS.items() if step * f <= 0.1), "ns")
    raise ConfigError(
        f"{path}: {column!r} begins at {times[0]:.6g} with steps of {step:.6g}, so it is perhaps "
        f"in {WORDS[likely]} (a factor of {UNITS[likely]:g}); {_state(likely)}, or "
        f"`s` where it was recorded that slowly"
    )


def _state(unit: str) -> str:
    return f"state its unit with `--time-unit {unit}`, in a rig with `time_unit: {unit}`"


def in_seconds(
    path: Path, column: str, times: Array, stated: str | None, notes: list[str] | None
) -> Array:
    """Return times in seconds.

    Parameters
    ----------
    path, column, times, stated
        As for `unit_of_times`.
    notes : list of str, optional
        Gets a sentence where the unit is another than seconds and is given by the file. Without
        a list it would not be reported, and such a unit has to be stated.

    Raises
    ------
    ConfigError
        The unit is not known.
    """
    unit, how = unit_of_times(path, column, times, stated)
    if unit == "s":
        return times
    if stated is None and notes is None:
        raise ConfigError(f"{path}: {column!r} is in {WORDS[unit]} {how}; {_state(unit)}")
    if stated is None and notes is not None:
        notes.append(
            f"The times in {column!r} were taken in {WORDS[unit]}, {how} (--time-unit chooses)."
        )
    factor = UNITS[unit]
    # A date in nanoseconds has no room for them beside it in a float: from the first one on.
    return np.asarray(factor * float(times[0]) + factor * (times - times[0]))
