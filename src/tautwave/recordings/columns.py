"""Columns of a recording by name, whatever kind of file it is: MCAP of ours, CSV, MAT."""

from __future__ import annotations

import csv
import importlib
import math
from collections.abc import Iterator, Mapping, Sequence
from io import TextIOWrapper
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from numpy.typing import NDArray

from tautwave.errors import ConfigError
from tautwave.reading import open_file
from tautwave.recordings import RUN
from tautwave.recordings.stated import Stated
from tautwave.recordings.times import in_seconds

Array = NDArray[np.float64]

MEND = "fill the gap or cut the recording there"
GREATEST = 1e50
"""Of a number in a recording: far beyond all that is measured, and its square is a number."""

MOST_ROWS = 10_000_000
"""Of CSV text: nearly three hours at 1 kHz."""
LONGEST_LINE = 1 << 20
"""Characters of a line of CSV text."""

UNSTATED = Stated()
SEPARATORS = (",", ";", "\t")


def recording_file(path: Path) -> Path:
    """Return the file of a recording: itself, or that of a run's directory."""
    return path / RUN if path.is_dir() else path


def column_names(path: Path) -> list[str]:
    """Return the names of the columns of a recording.

    Raises
    ------
    ConfigError
        It cannot be read.
    """
    path = recording_file(path)
    if path.suffix.lower() == ".mat":
        return list(_mat(path))
    if path.suffix.lower() == ".mcap":
        from tautwave.recordings.recording import read_recording

        return list(read_recording(path, rows=slice(0, 1)).columns)
    try:
        with _text(path) as stream:
            return _heading(path, stream)[0]
    except (OSError, ValueError, csv.Error) as err:
        raise ConfigError(f"{path}: cannot be read as CSV text: {err}") from err


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
    if path.suffix.lower() == ".mcap":
        from tautwave.recordings.recording import read_recording

        recording = read_recording(path, wanted)
        found = {name: np.array(recording[name]) for name in wanted}
    elif path.suffix.lower() == ".mat":
        found = _of(path, _mat(path), wanted)
    else:
        found = _csv(path, wanted, holes)
    _check(path, found, time_column, holes)
    found[time_column] = in_seconds(path, time_column, found[time_column], stated.time_unit, notes)
    return found


def read_column(
    path: Path, column: str, time_column: str, stated: Stated = UNSTATED
) -> tuple[Array, Array]:
    """Read times [s] and the values of one column, as `read_columns` does."""
    found = read_columns(path, [column], time_column, stated=stated)
    return found[time_column], found[column]


def _of(path: Path, columns: Mapping[str, Array], wanted: Sequence[str]) -> dict[str, Array]:
    for name in wanted:
        if name not in columns:
            raise ConfigError(
                f"{path}: there is no column {name!r}; "
                f"available: {', '.join(columns) or 'none, the file is empty'}"
            )
    return {name: columns[name] for name in wanted}


def _check(path: Path, found: Mapping[str, Array], time_column: str, holes: bool) -> None:
    times = found[time_column]
    for name, values in found.items():
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
                f"{path}: row {at + 1}: {name!r} is {_wrong(float(values[at]))}; {MEND}"
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


def _wrong(number: float | None) -> str:
    if number is None or not math.isfinite(number):
        return "not a finite number"
    return f"beyond the plausible limit {GREATEST:g}"


def _mat(path: Path) -> dict[str, Array]:
    """Return the numeric vectors of a MATLAB file: `name`, `struct.field`, `matrix[0]`."""
    try:
        io = importlib.import_module("scipy.io")
    except ImportError as err:
        raise ConfigError(f"{path}: this needs scipy; pip install 'tautwave[analysis]'") from err
    try:
        with open_file(path) as file:
            content = io.loadmat(file, simplify_cells=True)
    except NotImplementedError as err:
        raise ConfigError(
            f"{path}: is a MATLAB 7.3 file, which cannot be read; save it with -v7"
        ) from err
    except (OSError, ValueError, TypeError, io.matlab.MatReadError) as err:
        raise ConfigError(f"{path}: cannot be read as a MATLAB file: {err}") from err
    found: dict[str, Array] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, found)
    return found


def _flatten(name: str, value: Any, found: dict[str, Array]) -> None:
    if isinstance(value, dict):
        for key, inner in value.items():
            _flatten(f"{name}.{key}", inner, found)
        return
    if isinstance(value, list):
        for at, inner in enumerate(value):
            _flatten(f"{name}[{at}]", inner, found)
        return
    array = np.asarray(value)
    if array.dtype.kind not in "fiub" or array.ndim not in (1, 2):
        return
    if array.ndim == 1:
        found[name] = array.astype(np.float64)
        return
    if array.shape[0] < array.shape[1]:  # samples are along the longer side
        array = array.T
    for at, column in enumerate(array.T):
        found[f"{name}[{at}]"] = column.astype(np.float64)


def _text(path: Path) -> TextIO:
    return TextIOWrapper(open_file(path), encoding="utf-8-sig", newline="")


def _lines(path: Path, file: TextIO) -> Iterator[str]:
    """Yield lines; a file without any would be read whole as the first one."""
    while line := file.readline(LONGEST_LINE):
        if len(line) == LONGEST_LINE:
            raise ConfigError(f"{path}: a line of over {LONGEST_LINE} characters, so not CSV text")
        yield line


def _heading(path: Path, file: TextIO) -> tuple[list[str], str, int]:
    """Read the names of the columns, their separator, and the number of their line."""
    number, line = 1, file.readline(LONGEST_LINE)
    while line.startswith("#"):
        number, line = number + 1, file.readline(LONGEST_LINE)
    separator = max(SEPARATORS, key=line.count)
    names = [name.strip() for name in next(csv.reader([line], delimiter=separator), [])]
    if names and all(_number(name, separator) is not None for name in names):
        raise ConfigError(
            f"{path}:{number}: starts with numbers; the first line must hold the column names"
        )
    return names, separator, number


def _number(cell: str, separator: str) -> float | None:
    """Return a number, with a decimal comma where commas separate nothing; None if it is none."""
    try:
        return float(cell if separator == "," else cell.replace(",", "."))
    except ValueError:
        return None


def _csv(path: Path, wanted: Sequence[str], holes: bool) -> dict[str, Array]:
    """Read some columns of a CSV file with a header line; the first of them is the time."""
    rows_read: list[list[float]] = []
    try:
        with _text(path) as file:
            header, separator, before = _heading(path, file)
            rows = csv.reader(_lines(path, file), delimiter=separator)
            for name in wanted:
                if name not in header:
                    raise ConfigError(
                        f"{path}: there is no column {name!r}; "
                        f"available: {', '.join(header) or 'none, the file is empty'}"
                    )
            places = [header.index(name) for name in wanted]
            for row in rows:
                if not any(cell.strip() for cell in row):
                    continue
                numbers: list[float] = []
                for name, index in zip(wanted, places, strict=True):
                    cell = row[index].strip() if index < len(row) else ""
                    number = _number(cell, separator) if cell else math.nan
                    missing = number is not None and math.isnan(number)
                    if number is None or not (
                        abs(number) < GREATEST or (missing and holes and numbers)
                    ):
                        raise ConfigError(
                            f"{path}:{before + rows.line_num}: column {name!r} holds {cell!r}, "
                            f"{_wrong(number)}; {MEND}"
                        )
                    numbers.append(number)
                if rows_read and not numbers[0] > rows_read[-1][0]:
                    raise ConfigError(
                        f"{path}:{before + rows.line_num}: time must increase, "
                        f"but {numbers[0]:.12g} follows {rows_read[-1][0]:.12g}"
                    )
                if len(rows_read) == MOST_ROWS:
                    raise ConfigError(f"{path}: more than {MOST_ROWS} rows; cut it, or thin it out")
                rows_read.append(numbers)
    except (OSError, UnicodeDecodeError, csv.Error) as err:
        raise ConfigError(f"{path}: the recording cannot be read: {err}") from err
    if len(rows_read) < 2:
        raise ConfigError(f"{path}: a recording needs at least two rows, it has {len(rows_read)}")
    return dict(zip(wanted, np.array(rows_read).T.copy(), strict=True))
