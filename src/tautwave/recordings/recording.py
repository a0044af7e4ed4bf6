"""Read a recording back as NumPy arrays: chunk by chunk, even if its end is missing.

All messages of a chunk have the same length, so a decompressed chunk *is* a structured array. One
chunk is in memory at a time; a selection of columns or every n-th row keeps the result small.
"""

from __future__ import annotations

import difflib
import importlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautwave import formats
from tautwave.errors import ConfigError, RecordingError
from tautwave.reading import open_file
from tautwave.recordings import RUN
from tautwave.recordings.layout import DESCRIBED, ENDING_NAME, MAGIC, METADATA_NAME, record_type
from tautwave.recordings.mcap_chunks import chunk_records, walk_records


@dataclass(frozen=True)
class Recording:
    """A recording, or selected columns and rows of it.

    `recording["lever.position_error"]` is a column, `"lever.position_error" in recording` tests for
    it, `recording.columns` names all; `len` counts rows, a loop over it gives each row by column
    name, one at a time and slowly. Rows come as `to_pandas()` and `to_arrow()`, too.

    Attributes
    ----------
    columns
        Names of the columns of `data`.
    data
        float64, shape (rows, columns), each column contiguous.
    metadata
        As given to the recorder (`version`, `rate_hz`, ...).
    attachments
        Content by file name.
    truncated
        The file has no end: its writer was killed, the disk was full, or the run is still going.
        The rows read are complete.
    damaged_chunks
        Chunks left out because their checksum or compression is wrong.
    missing_rows
        Cycles between the first and the last row read that are not in the file (a full ring).
        Zero when only some rows were read.
    ending
        `rows_offered`, `rows_written`, `rows_dropped`, `ended_by`; empty when truncated.
    """

    columns: tuple[str, ...]
    data: NDArray[np.float64]
    metadata: dict[str, str]
    attachments: dict[str, bytes]
    truncated: bool
    damaged_chunks: int
    missing_rows: int
    ending: dict[str, str]

    def __len__(self) -> int:
        return len(self.data)

    def __iter__(self) -> Iterator[dict[str, float]]:
        """Row by row, each a number by name of its column."""
        for row in self.data:
            yield dict(zip(self.columns, row.tolist(), strict=True))

    def __contains__(self, name: object) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        try:
            column: NDArray[np.float64] = self.data[:, self.columns.index(name)]
        except ValueError as error:
            raise RecordingError(_unknown(name, self.columns)) from error
        return column

    @property
    def units(self) -> dict[str, str]:
        """SI unit of each column that has one, as recorded; none in recordings before 0.3."""
        told = described_in(self.metadata)
        return {name: told[name][0] for name in self.columns if told.get(name, ("",))[0]}

    @property
    def meanings(self) -> dict[str, str]:
        """What each column is, in words, as recorded; none in recordings before 0.3."""
        told = described_in(self.metadata)
        return {name: told[name][1] for name in self.columns if name in told}

    def to_pandas(self) -> Any:
        """Return the rows as a `pandas.DataFrame`: a column by name each, indexed by `time_s` [s].

        Without the column `time_s` the index counts rows. `metadata` is in `attrs`.

        Raises
        ------
        ConfigError
            pandas is not installed.
        """
        pandas = _library("pandas", "pandas")
        frame = pandas.DataFrame({name: self[name] for name in self.columns})
        if "time_s" in self.columns:
            frame = frame.set_index("time_s")
        frame.attrs.update(self.metadata)
        return frame

    def to_arrow(self) -> Any:
        """Return the rows as a `pyarrow.Table` of float64, `metadata` in its schema.

        Raises
        ------
        ConfigError
            pyarrow is not installed.
        """
        pyarrow = _library("pyarrow", "parquet")
        columns = [np.ascontiguousarray(self[name]) for name in self.columns]
        return pyarrow.table(columns, names=list(self.columns), metadata=self.metadata)

    @property
    def time_s(self) -> NDArray[np.float64]:
        """Time of each row since the start [s]."""
        return self["time_s"]

    def axes(self) -> tuple[str, ...]:
        """Axes among the columns, such as `master.wrist`."""
        parts = (name.split(".") for name in self.columns)
        return tuple(
            f"{p[0]}.{p[1]}"
            for p in parts
            if len(p) == 3 and p[0] in ("master", "slave") and p[2] == "position"
        )

    def pairs(self) -> tuple[str, ...]:
        """Pairs among the columns: those with a `position_error`."""
        parts = (name.rpartition(".") for name in self.columns)
        return tuple(pair for pair, _, leaf in parts if pair and leaf == "position_error")

    def elements(self, pair: str) -> tuple[str, ...]:
        """Controller elements of `pair` that keep an energy account."""
        parts = (name.split(".") for name in self.columns)
        return tuple(p[1] for p in parts if len(p) == 3 and p[0] == pair and p[2] == "absorbed")


def described_in(metadata: Mapping[str, str]) -> dict[str, tuple[str, str]]:
    """Return unit and meaning of each column that a recording's metadata describes."""
    try:
        told = json.loads(metadata.get(DESCRIBED, "{}"))
        return {str(name): (str(unit), str(what)) for name, (unit, what) in told.items()}
    except (ValueError, TypeError, AttributeError, RecursionError):
        return {}


def read_recording(
    path: str | os.PathLike[str],
    columns: Sequence[str] | None = None,
    *,
    rows: slice = slice(None),
    stride: int = 1,
) -> Recording:
    """Read a recording in one call.

    Parameters
    ----------
    path
        An MCAP file written by `tautwave run`, complete or not, or the directory of a run, which
        may still be going: the rows are then those already in the file (about a second late).
    columns
        Names to read, in this order; all by default.
    rows
        Which rows, like a slice of a list with a step of 1.
    stride
        Every n-th of these rows; chunks without one are skipped unread.

    Raises
    ------
    RecordingError
        No file, not MCAP, not written by tautwave, no rows, or an unknown column.
    """
    if os.path.isdir(path):
        in_directory = os.path.join(path, RUN)
        if not os.path.exists(in_directory):
            raise RecordingError(
                f"{os.fspath(path)} holds no {RUN}; give a recording, or the directory of a run"
            )
        path = in_directory
    name = os.fspath(path)
    if stride < 1 or rows.step not in (None, 1):
        raise RecordingError("only positive steps are supported: every n-th row with n >= 1")
    try:
        with open_file(path, buffering=0) as file:
            return _read(name, file.fileno(), columns, rows, stride)
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{name} cannot be read: {error.strerror}") from error


def _read(
    name: str, file: int, wanted: Sequence[str] | None, rows: slice, stride: int
) -> Recording:
    if os.fstat(file).st_size == 0:
        raise RecordingError(f"{name} is empty")
    if os.pread(file, len(MAGIC), 0) != MAGIC:
        raise RecordingError(f"{name} is not an MCAP file")
    contents = walk_records(file)
    own = contents.metadata.get(METADATA_NAME, {})
    newer = formats.too_new("recording", own.get("format"), formats.RECORDING)
    if newer is not None:
        raise RecordingError(f"{name}: format {newer}")
    recorded, places = _columns(name, own)
    selected = tuple(recorded) if wanted is None else tuple(wanted)
    for column in selected:
        if column not in places:
            raise RecordingError(f"{name}: {_unknown(column, recorded)}")
    fields = [places[column] for column in selected]
    kind = record_type(len(recorded))
    most = sum(chunk.size // kind.itemsize for chunk in contents.chunks)
    start, stop, _ = rows.indices(most)
    picked = range(start, stop, stride)
    data = np.empty((len(fields), len(picked)))
    filled, seen, damaged = 0, 0, 0
    first = last = 0
    for chunk in contents.chunks:
        whole, extra = divmod(chunk.size, kind.itemsize)
        skip = -(seen - start) % stride if seen > start else start - seen
        if extra == 0 and (skip >= whole or seen + skip >= stop):
            seen += whole
            continue
        records = chunk_records(file, chunk, kind)
        if records is None:
            damaged += 1
            continue
        if len(records) == 0:
            continue
        part = records["row"][skip : max(0, stop - seen) : stride]
        data[:, filled : filled + len(part)] = part[:, fields].T
        filled += len(part)
        if seen == 0:
            first = int(records["sequence"][0])
        last = int(records["sequence"][-1])
        seen += len(records)
    if seen == 0:
        raise RecordingError(f"{name} holds no rows")
    metadata = {key: text for key, text in own.items() if key not in ("columns", "order")}
    everything = filled == seen and not damaged
    return Recording(
        columns=selected,
        data=data[:, :filled].T,
        metadata=metadata,
        attachments=contents.attachments,
        truncated=not contents.complete,
        damaged_chunks=damaged,
        missing_rows=last - first + 1 - seen if everything else 0,
        ending=contents.metadata.get(ENDING_NAME, {}),
    )


def _columns(name: str, own: dict[str, str]) -> tuple[list[str], dict[str, int]]:
    """Names of the columns as the loop had them, and where each lies in a message."""
    try:
        recorded, order = json.loads(own["columns"]), json.loads(own["order"])
    except (KeyError, ValueError, RecursionError) as error:
        raise RecordingError(
            f"{name} is an MCAP file, but not a tautwave recording: it has no column names"
        ) from error
    # Field k of a message is column order[k] of the row.
    named = isinstance(recorded, list) and all(isinstance(one, str) for one in recorded)
    numbered = isinstance(order, list) and all(isinstance(one, int) for one in order)
    if (
        not (named and numbered)
        or sorted(order) != list(range(len(recorded)))
        or len(set(recorded)) != len(order)
    ):
        raise RecordingError(f"{name}: its column names are damaged")
    return recorded, {recorded[index]: k for k, index in enumerate(order)}


def _library(name: str, extra: str) -> Any:
    """Import an optional library, or raise an error with installation instructions."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        message = f"this needs {name}; pip install 'tautwave[{extra}]'"
        raise ConfigError(message) from error


def _unknown(name: str, known: Sequence[str]) -> str:
    nearest = difflib.get_close_matches(name, known, 1)
    hint = f"; did you mean {nearest[0]!r}?" if nearest else ""
    return f"there is no column {name!r}{hint}"
