"""Columns of a recording by name, whatever kind of file it is: MCAP of ours, CSV, MAT."""

from __future__ import annotations

import csv
import importlib
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautwave.errors import ConfigError
from tautwave.recordings import RUN

Array = NDArray[np.float64]


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
    if path.suffix == ".mat":
        return list(_mat(path))
    if path.suffix == ".mcap":
        from tautwave.recordings.recording import read_recording

        return list(read_recording(path, rows=slice(0, 1)).columns)
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            heading = next(csv.reader([stream.readline(1 << 16)]), [])
    except (OSError, ValueError, csv.Error) as err:
        raise ConfigError(f"{path}: cannot be read as CSV text: {err}") from err
    return [name.strip() for name in heading]


def read_columns(path: Path, names: Sequence[str], time_column: str) -> dict[str, Array]:
    """Read some columns of a recording and its times [s], which increase, by their names.

    Raises
    ------
    ConfigError
        Its message names the file and its columns, or the first value that is wrong.
    """
    path = recording_file(path)
    wanted = list(dict.fromkeys([time_column, *names]))
    if path.suffix == ".mcap":
        from tautwave.recordings.recording import read_recording

        recording = read_recording(path, wanted)
        found = {name: np.array(recording[name]) for name in wanted}
    elif path.suffix == ".mat":
        found = _of(path, _mat(path), wanted)
    else:
        return _csv(path, wanted)
    _check(path, found, time_column)
    return found


def read_column(path: Path, column: str, time_column: str) -> tuple[Array, Array]:
    """Read times [s] and the values of one column, as `read_columns` does."""
    found = read_columns(path, [column], time_column)
    return found[time_column], found[column]


def _of(path: Path, columns: Mapping[str, Array], wanted: Sequence[str]) -> dict[str, Array]:
    for name in wanted:
        if name not in columns:
            raise ConfigError(
                f"{path}: there is no column {name!r}; "
                f"available: {', '.join(columns) or 'none, the file is empty'}"
            )
    return {name: columns[name] for name in wanted}


def _check(path: Path, found: Mapping[str, Array], time_column: str) -> None:
    times = found[time_column]
    for name, values in found.items():
        if len(values) != len(times):
            raise ConfigError(
                f"{path}: {name!r} has {len(values)} values, {time_column!r} has {len(times)}"
            )
        if not np.all(np.isfinite(values)):
            at = int(np.argmin(np.isfinite(values)))
            raise ConfigError(f"{path}: row {at + 1}: {name!r} is not a finite number")
    if len(times) < 2:
        raise ConfigError(f"{path}: a recording needs at least two rows, it has {len(times)}")
    steps = np.diff(times)
    if not np.all(steps > 0.0):
        at = int(np.argmax(steps <= 0.0))
        raise ConfigError(
            f"{path}: row {at + 2}: time must increase, "
            f"but {times[at + 1]:g} s follows {times[at]:g} s"
        )


def _mat(path: Path) -> dict[str, Array]:
    """Return the numeric vectors of a MATLAB file: `name`, `struct.field`, `matrix[0]`."""
    try:
        io = importlib.import_module("scipy.io")
    except ImportError as err:
        raise ConfigError(f"{path}: this needs scipy; pip install 'tautwave[analysis]'") from err
    try:
        content = io.loadmat(os.fspath(path), simplify_cells=True)
    except NotImplementedError as err:
        raise ConfigError(
            f"{path}: is of MATLAB's version 7.3, which is not read; save it with -v7"
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


def _csv(path: Path, wanted: Sequence[str]) -> dict[str, Array]:
    """Read some columns of a CSV file with a header line; the first of them is the time."""
    rows_read: list[list[float]] = []
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = csv.reader(file)
            header = [name.strip() for name in next(rows, [])]
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
                numbers = []
                for name, index in zip(wanted, places, strict=True):
                    cell = row[index].strip() if index < len(row) else ""
                    try:
                        number = float(cell)
                    except ValueError:
                        number = math.nan
                    if not math.isfinite(number):
                        raise ConfigError(
                            f"{path}:{rows.line_num}: column {name!r} holds {cell!r}, "
                            "not a finite number"
                        )
                    numbers.append(number)
                if rows_read and not numbers[0] > rows_read[-1][0]:
                    raise ConfigError(
                        f"{path}:{rows.line_num}: time must increase, "
                        f"but {numbers[0]:g} s follows {rows_read[-1][0]:g} s"
                    )
                rows_read.append(numbers)
    except (OSError, UnicodeDecodeError, csv.Error) as err:
        raise ConfigError(f"{path}: the recording cannot be read: {err}") from err
    if len(rows_read) < 2:
        raise ConfigError(f"{path}: a recording needs at least two rows, it has {len(rows_read)}")
    return dict(zip(wanted, np.array(rows_read).T.copy(), strict=True))
