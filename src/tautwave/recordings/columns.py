"""Columns of a recording by name, whatever kind of file it is: one table of readers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from tautwave.errors import ConfigError
from tautwave.recordings import RUN
from tautwave.recordings.readers.arrays import (
    npz_columns,
    npz_names,
    parquet_columns,
    parquet_names,
)
from tautwave.recordings.readers.lerobot import dataset_columns, dataset_names, is_dataset
from tautwave.recordings.readers.matlab import matlab_columns, matlab_names
from tautwave.recordings.readers.ros_bag import bag_columns, bag_names, is_bag
from tautwave.recordings.readers.shared import GREATEST, MEND, Array, wrong
from tautwave.recordings.readers.text import text_columns, text_names
from tautwave.recordings.stated import UNSTATED, Stated
from tautwave.recordings.times import in_seconds

MADE = "time_s"
"""Name of the times of a recording that has none, but a rate."""


class ReadColumns(Protocol):
    """Reads the wanted columns of a file; with `holes` numbers may be missing, and are NaN."""

    def __call__(
        self, path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
    ) -> dict[str, Array]:
        """Return the columns by name; ConfigError where it cannot."""


class Reader(NamedTuple):
    """A kind of recording: whether a path is one, the names of its columns, and the columns."""

    takes: Callable[[Path], bool]
    names: Callable[[Path, Stated], list[str]]
    columns: ReadColumns


def _suffix(*suffixes: str) -> Callable[[Path], bool]:
    return lambda path: path.suffix.lower() in suffixes


def _own_names(path: Path, stated: Stated) -> list[str]:
    from tautwave.recordings.recording import read_recording

    return list(read_recording(path, rows=slice(0, 1)).columns)


def _own_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    from tautwave.recordings.recording import read_recording

    recording = read_recording(path, wanted)
    return {name: np.array(recording[name]) for name in wanted}


READERS = (
    Reader(is_dataset, dataset_names, dataset_columns),
    Reader(is_bag, bag_names, bag_columns),
    Reader(_suffix(".mcap"), _own_names, _own_columns),
    Reader(_suffix(".mat"), matlab_names, matlab_columns),
    Reader(_suffix(".npz"), npz_names, npz_columns),
    Reader(_suffix(".parquet", ".pq"), parquet_names, parquet_columns),
    Reader(lambda path: True, text_names, text_columns),
)
"""The first that takes a path reads it."""


def recording_file(path: Path) -> Path:
    """Return the file of a recording: itself, or that of a run's directory."""
    return path / RUN if path.is_dir() and not (is_dataset(path) or is_bag(path)) else path


def is_own(path: Path) -> bool:
    """Return whether a file is a recording of ours, which has axes."""
    return path.suffix.lower() == ".mcap" and not is_bag(path)


def _reader(path: Path) -> Reader:
    return next(reader for reader in READERS if reader.takes(path))


def column_names(path: Path, stated: Stated = UNSTATED) -> list[str]:
    """Return the names of the columns of a recording.

    Raises
    ------
    ConfigError
        It cannot be read.
    """
    path = recording_file(path)
    names = _reader(path).names(path, stated)
    made = stated.rate_hz is not None and MADE not in names
    return [MADE, *names] if made else names


def read_columns(
    path: Path,
    names: Sequence[str],
    time_column: str,
    *,
    stated: Stated = UNSTATED,
    holes: bool = False,
    notes: list[str] | None = None,
) -> dict[str, Array]:
    """Read some columns of a recording and its times [s], which increase, by their names.

    Parameters
    ----------
    path : Path
        A file, or a run's directory.
    names, time_column : str
        Of the columns.
    stated : Stated
        What the file does not say itself.
    holes : bool
        Values may be missing, and are NaN then; times never.
    notes : list of str, optional
        Gets a sentence where times were not in seconds; without it their unit has to be stated.

    Raises
    ------
    ConfigError
        Its message names the file and its columns, or the first value that is wrong.
    """
    path = recording_file(path)
    wanted = list(dict.fromkeys([time_column, *names]))
    if stated.rate_hz is not None:  # its rows are evenly spaced, whatever times the file has
        wanted.remove(time_column)
    columns = _reader(path).columns(path, wanted, stated, holes=holes)
    if stated.rate_hz is not None:
        count = len(next(iter(columns.values()), ()))
        columns[time_column] = np.arange(count) / stated.rate_hz
    _check(path, columns, time_column, holes)
    if stated.rate_hz is None:
        columns[time_column] = in_seconds(
            path, time_column, columns[time_column], stated.time_unit, notes
        )
    return columns


def read_column(
    path: Path, column: str, time_column: str, stated: Stated = UNSTATED
) -> tuple[Array, Array]:
    """Read times [s] and the values of one column, as `read_columns` does."""
    columns = read_columns(path, [column], time_column, stated=stated)
    return columns[time_column], columns[column]


def _check(path: Path, columns: Mapping[str, Array], time_column: str, holes: bool) -> None:
    times = columns[time_column]
    for name, values in columns.items():
        if len(values) != len(times):
            raise ConfigError(
                f"{path}: {name!r} has {len(values)} values, {time_column!r} has {len(times)}"
            )
        good = np.abs(values) < GREATEST
        if holes and name != time_column:
            good |= np.isnan(values)
        if not np.all(good):
            at = int(np.argmin(good))
            raise ConfigError(
                f"{path}: row {at + 1}: {name!r} is {wrong(float(values[at]))}; {MEND}"
            )
    if len(times) < 2:
        raise ConfigError(f"{path}: a recording needs at least two rows, it has {len(times)}")
    steps = np.diff(times)
    if not np.all(steps > 0.0):
        at = int(np.argmax(steps <= 0.0))
        raise ConfigError(
            f"{path}: row {at + 2}: time must increase, "
            f"but {times[at + 1]:.12g} follows {times[at]:.12g}"
        )
