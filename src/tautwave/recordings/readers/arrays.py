"""Arrays by name: NumPy's npz, Parquet."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.errors import ConfigError
from tautwave.reading import open_file
from tautwave.recordings.readers.shared import Array, chosen, flatten, library
from tautwave.recordings.stated import Stated


def npz_names(path: Path, stated: Stated) -> list[str]:
    """Return the names of the numeric vectors of an npz file."""
    return list(_vectors(path))


def npz_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    """Read numeric vectors of an npz file: `name`, `matrix[0]`."""
    return chosen(path, _vectors(path), wanted)


def _vectors(path: Path) -> dict[str, Array]:
    vectors: dict[str, Array] = {}
    try:
        with open_file(path) as file, np.load(file, allow_pickle=False) as content:
            for name in content.files:
                flatten(name, content[name], vectors)
    except (OSError, ValueError, AttributeError, zipfile.BadZipFile) as err:
        raise ConfigError(f"{path}: cannot be read as an npz file: {err}") from err
    return vectors


def parquet_names(path: Path, stated: Stated) -> list[str]:
    """Return the names of the numeric columns of a Parquet file."""
    return list(parquet_table(path, None))


def parquet_columns(
    path: Path, wanted: Sequence[str], stated: Stated, *, holes: bool
) -> dict[str, Array]:
    """Read numeric columns of a Parquet file; of lists of equal length each element is one."""
    return chosen(path, parquet_table(path, None), wanted)


def parquet_table(
    path: Path, filters: Any, names: dict[str, list[str]] | None = None
) -> dict[str, Array]:
    """Return the numeric columns of a Parquet file, in the rows that filters of PyArrow leave.

    `names` are those of the elements of list columns, by column; others are `column[0]`.

    Raises
    ------
    ConfigError
        It cannot be read.
    """
    parquet = library(path, "pyarrow.parquet", "parquet")
    lib = library(path, "pyarrow", "parquet")
    columns: dict[str, Array] = {}
    try:
        with open_file(path) as file:
            table = parquet.read_table(file, filters=filters)
    except (OSError, lib.ArrowException) as err:
        raise ConfigError(f"{path}: cannot be read as Parquet: {err}") from err
    types = lib.types
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if types.is_timestamp(kind):
            column = column.cast(lib.int64())
        if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
            rows = column.to_pylist()
            if not rows or any(row is None or len(row) != len(rows[0]) for row in rows):
                continue
            parts = np.array(rows)
            if parts.ndim != 2 or parts.dtype.kind not in "fiub":
                continue
            known = (names or {}).get(name, [])
            for at, part in enumerate(parts.T):
                fits = len(known) == parts.shape[1]
                columns[f"{name}.{known[at]}" if fits else f"{name}[{at}]"] = part.astype(
                    np.float64
                )
        elif (
            types.is_integer(column.type)
            or types.is_floating(column.type)
            or types.is_boolean(kind)
        ):
            flatten(name, column.to_numpy(), columns)
    return columns
