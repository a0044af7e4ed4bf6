"""Columns of a long recording, each contiguous: a recording stores them row by row.

Extracting one column of an hour means decompressing everything, a few seconds each time. This does
it once, into an unnamed file that vanishes when it is closed, whatever happens.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
import weakref
from pathlib import Path
from typing import BinaryIO

import numpy as np

from tautwave.errors import RecordingError
from tautwave.report.figures.envelope import Floats

BLOCK_CELLS = 10_000_000  # 80 MB at a time


class Scratch:
    """Columns of `rows` float64 in a file. It is closed with the last reference to it."""

    def __init__(self, file: BinaryIO, columns: tuple[str, ...], rows: int) -> None:
        self._file = file
        weakref.finalize(self, file.close)
        self._at = {name: 8 * rows * index for index, name in enumerate(columns)}
        self._rows = rows

    def write(self, name: str, first: int, values: Floats) -> None:
        """Write `values` into column `name` from row `first` on."""
        self._file.seek(self._at[name] + 8 * first)
        piece = np.ascontiguousarray(values).data
        if self._file.write(piece) != piece.nbytes:
            raise OSError(errno.ENOSPC, "no room for the columns of a long recording")

    def read(self, name: str, rows: slice = slice(None)) -> Floats:
        """Rows of one column."""
        first, last, _ = rows.indices(self._rows)
        values = np.empty(max(0, last - first))
        self._file.seek(self._at[name] + 8 * first)
        self._file.readinto(values.data)  # type: ignore[attr-defined]
        return values


def spread_columns(path: Path, columns: tuple[str, ...], rows: int) -> Scratch | None:
    """Copy a recording column by column; None if the disk has no room for it.

    Raises
    ------
    RecordingError
        The recording cannot be read.
    """
    from tautwave.recordings.recording import read_recording

    needed = 8 * rows * len(columns)
    folder = next((f for f in (path.parent, Path(tempfile.gettempdir())) if _fits(f, needed)), None)
    if folder is None:
        return None
    file = tempfile.TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115 - lives in the Scratch
    scratch = Scratch(file, columns, rows)
    block = max(1, BLOCK_CELLS // len(columns))
    try:
        for first in range(0, rows, block):
            part = read_recording(path, columns, rows=slice(first, first + block))
            for name in columns:
                scratch.write(name, first, part[name])
    except RecordingError:
        file.close()
        raise
    except OSError:
        file.close()
        return None
    return scratch


def _fits(folder: Path, needed: int) -> bool:
    try:
        free = shutil.disk_usage(folder).free
    except OSError:
        return False
    return os.access(folder, os.W_OK) and free > 2 * needed
