"""The table of a sweep: a CSV file that survives interruptions, sorted at the end.

Rows are appended as they finish. Memory holds a few bytes per point: its id and, during the sort,
the place of its row.
"""

from __future__ import annotations

import csv
import fcntl
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from tautwave.errors import RecordingError

Row = dict[str, str]
Ids = npt.NDArray[np.uint64]


class TableRows:
    """Rows of a table, read from the file each time, not cached."""

    def __init__(self, path: Path, count: int) -> None:
        self._path = path
        self._count = count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Row]:
        with self._path.open(newline="", encoding="utf-8") as file:
            yield from csv.DictReader(file)


class SweepTable:
    """The open table of one sweep; `with` closes it.

    Parameters
    ----------
    path : Path
        The file; created if needed, resumed if it exists.
    header : sequence of str
        Its columns.
    ids : ndarray
        Ids of all points of the sweep, in order, shape (n,).

    Raises
    ------
    RecordingError
        The file belongs to another sweep, or another process is writing to it.
    """

    def __init__(self, path: Path, header: Sequence[str], ids: Ids) -> None:
        self.path = path
        self._header = list(header)
        self._order = np.argsort(ids)
        self._sorted = ids[self._order]
        self.done = np.zeros(len(ids), dtype=np.bool_)
        self._file = path.open("a+b")
        try:
            self._lock()
            self._take_over()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> SweepTable:
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._file.close()

    def _lock(self) -> None:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as err:
            raise RecordingError(
                f"{self.path}: another sweep is writing to it; wait, or give a new --out"
            ) from err

    def _number(self, identity: str) -> int:
        """Return the index of the point with this id, -1 if there is none."""
        try:
            value = np.uint64(int(identity, 16))
        except (ValueError, OverflowError):
            return -1
        at = int(np.searchsorted(self._sorted, value))
        if at == len(self._sorted) or self._sorted[at] != value:
            return -1
        return int(self._order[at])

    def _take_over(self) -> None:
        """Read the existing rows; cut off an incomplete last line."""
        end = 0
        foreign = rows = 0
        self._file.seek(0)
        for line in self._file:
            if not line.endswith(b"\n"):
                break
            if end == 0:
                self._check_header(line)
            else:
                number = self._number(line[:16].decode("ascii", "replace"))
                rows += 1
                if number < 0:
                    foreign += 1
                elif line.count(b",") >= len(self._header) - 1:
                    self.done[number] = True
            end += len(line)
        if foreign:
            raise RecordingError(
                f"{self.path}: {foreign} of its {rows} points are not in this sweep (the file or "
                f"the rig changed); give a new --out, or remove it first"
            )
        self._file.truncate(end)
        if end == 0:
            self._file.write((",".join(self._header) + "\n").encode())
            self._file.flush()

    def _check_header(self, line: bytes) -> None:
        if line.decode("utf-8", "replace").rstrip("\n").split(",") != self._header:
            raise RecordingError(
                f"{self.path}: has different columns from this sweep; give "
                "a new --out, or remove it "
                "first"
            )

    def append(self, numbers: Sequence[int], text: str) -> None:
        """Append finished rows, one line each, and flush them."""
        self._file.write(text.encode())
        self._file.flush()
        self.done[list(numbers)] = True

    def put_in_order(self) -> None:
        """Atomically replace the file by one in the order of the sweep, each point once."""
        places = np.full(len(self.done), -1, dtype=np.int64)
        self._file.seek(0)
        head = self._file.readline()
        at = len(head)
        last = -1
        sorted_already = True
        for line in self._file:
            number = self._number(line[:16].decode("ascii", "replace"))
            sorted_already = sorted_already and number > last
            last = number
            if number >= 0:
                places[number] = at
            at += len(line)
        if sorted_already:
            return
        part = self.path.with_suffix(".part")
        with part.open("wb") as out:
            out.write(head)
            for place in places[places >= 0]:
                self._file.seek(int(place))
                out.write(self._file.readline())
        os.replace(part, self.path)


def line_of(header: Sequence[str], row: Mapping[str, str]) -> str:
    """Return a row as a line of CSV; cells with commas or quotes are quoted."""
    return ",".join([_quoted(row.get(name, "")) for name in header]) + "\n"


def _quoted(cell: str) -> str:
    if "," not in cell and '"' not in cell and "\n" not in cell and "\r" not in cell:
        return cell
    return '"' + cell.replace('"', '""').replace("\n", " ").replace("\r", " ") + '"'
