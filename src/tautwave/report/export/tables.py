"""A run as tables, one file an episode: CSV, Parquet, NumPy's npz or MATLAB's mat. SI units.

Beside what was recorded, `slave.AXIS.target` is where each pair wanted its slave, in the slave's
coordinates: those of the master change at each clutch.
"""

from __future__ import annotations

import csv
import importlib
import io
import itertools
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tautwave.errors import ConfigError
from tautwave.files import make_directory, write_bytes, write_text
from tautwave.recordings.recording import Recording, read_recording
from tautwave.report.export.episodes import axis_blocks, episodes, pair_ratios, units
from tautwave.report.export.signals import SCALE, STATE, Signal, engaged, targets

BLOCK = 1 << 14
"""Rows that are in memory at once, of a format that grows."""
LARGEST_MAT = 2**32 - 2**20
"""Bytes; a structure states its length in 32 bits."""
LONGEST = 58
"""Characters of a field in MATLAB that is not numbered: of 63, with room for a number."""
INDEX = ("file", "number", "name", "task", "success", "begin_s", "end_s", "rows", "engaged_rows")


def export_tables(
    directory: Path, to: str, out: Path, columns: Sequence[str] | None = None
) -> list[Path]:
    """Write the episodes of a run into `out`, and `episodes.csv`, which lists them.

    A run without episodes is one file, `run`. `time_s` and all other columns are as recorded;
    `slave.AXIS.target` is added.

    Parameters
    ----------
    directory : Path
        Of the run.
    to : str
        One of `TABLES`.
    out : Path
        Created if needed. No table in it is replaced.
    columns : sequence of str, optional
        Columns to write; all by default.

    Returns
    -------
    list of Path
        What was written, the index last.

    Raises
    ------
    RecordingError
        There is no recording, or a column is unknown.
    ConfigError
        A library is not installed, a table exists already, or `out` is named as a file.
    WritingError
        Something cannot be written.
    """
    content = TABLES[to]
    # before a folder is made for what is not there
    chosen = [one for one in episodes(directory) if not one.discarded]
    if out.suffix == f".{to}":
        raise ConfigError(f"{out}: tables go into a directory, one for each episode; name that")
    paths = [out / f"{episode.stem}.{to}" for episode in chosen]
    there = next(filter(Path.exists, paths), None)
    if there is not None:
        raise ConfigError(f"{there} exists; choose another --out, or remove it first")
    head = read_recording(directory, rows=slice(0, 1))
    axes, ratios = axis_blocks(head.attachments), pair_ratios(head.attachments)
    added = {one.name: one for one in targets(axes, ratios, head.columns)}
    wanted = [*head.columns, *added] if columns is None else columns
    scale = [name for name in head.columns if name == SCALE]
    begun = _Rows(directory, wanted, added, scale, 0, 1)
    begun.all()  # an unknown column leaves no directory
    make_directory(out)
    written, lines = [], []
    ends = ["time_s", *([STATE] if STATE in head.columns else [])]
    for episode, path in zip(chosen, paths, strict=True):
        marks = read_recording(directory, ends, rows=episode.rows)
        times = marks.time_s
        engaged_rows = np.count_nonzero(engaged(marks[STATE])) if STATE in marks else ""
        rows = begun._replace(begin=episode.rows.start or 0, length=len(times))
        write_bytes(path, content(rows))
        written.append(path)
        success = "" if episode.success is None else str(episode.success).lower()
        between = [f"{times[0]:.9g}", f"{times[-1]:.9g}"] if len(times) else ["", ""]
        named = [path.name, episode.number, episode.name, episode.task]
        lines.append([*named, success, *between, len(times), engaged_rows])
    index = io.StringIO()
    csv.writer(index, lineterminator="\n").writerows([INDEX, *lines])
    write_text(out / "episodes.csv", index.getvalue())
    return [*written, out / "episodes.csv"]


class _Rows(NamedTuple):
    """Rows of an episode, read when they are asked for: all columns of an hour are gigabytes.

    `added` are columns that a recording has not, `scale` is the column of the live scale, if any.
    """

    directory: Path
    columns: Sequence[str]
    added: Mapping[str, Signal]
    scale: Sequence[str]
    begin: int
    length: int

    def all(self) -> Recording:
        """Return all of them."""
        return self._read(0, self.length)

    def blocks(self) -> Iterator[Recording]:
        """Give them in their order, some at a time."""
        for at in range(0, self.length, BLOCK):
            yield self._read(at, min(at + BLOCK, self.length))

    def _read(self, begin: int, end: int) -> Recording:
        rows = slice(self.begin + begin, self.begin + end)
        made = [self.added[name] for name in self.columns if name in self.added]
        if not made:
            return read_recording(self.directory, self.columns, rows=rows)
        plain = [name for name in self.columns if name not in self.added]
        more = [column for one in made for column in one.columns]
        needed = tuple(dict.fromkeys([*plain, *more, *self.scale]))
        recording = read_recording(self.directory, needed, rows=rows)
        row = {name: recording[name] for name in recording.columns}
        row |= {one.name: one.of(row) for one in made}
        data = np.array([row[name] for name in self.columns]).T
        return replace(recording, columns=tuple(self.columns), data=data)


def _csv(episode: _Rows) -> Iterator[bytes]:
    # A heading of names only is what every reader of CSV takes: no units.
    for number, rows in enumerate(episode.blocks()):
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if not number:
            writer.writerow(rows.columns)
        writer.writerows(row.tolist() for row in rows.data)
        yield text.getvalue().encode("utf-8")


def _npz(episode: _Rows) -> bytes:
    rows = episode.all()  # an array of npz has no place for a unit
    packed = io.BytesIO()
    arrays: dict[str, Any] = {name: rows[name] for name in rows.columns}
    np.savez_compressed(packed, **arrays)
    return packed.getvalue()


def _parquet(episode: _Rows) -> bytes:
    writer: Any = None
    packed = io.BytesIO()
    for rows in episode.blocks():
        table = rows.to_arrow()
        if writer is None:
            stated = units(rows)
            fields = [
                field.with_metadata({"unit": stated[field.name]}) if field.name in stated else field
                for field in table.schema
            ]
            schema = importlib.import_module("pyarrow").schema(fields, table.schema.metadata)
            writer = importlib.import_module("pyarrow.parquet").ParquetWriter(packed, schema)
        writer.write_table(table.cast(schema))
    writer.close()
    return packed.getvalue()


def _mat(episode: _Rows) -> bytes:
    """Return a MAT file, level 5: `recording`, a structure by the dots of names, and `units`."""
    try:
        io_module = importlib.import_module("scipy.io")
    except ImportError as err:
        raise ConfigError(
            "--to mat needs SciPy: pip install 'tautwave[analysis]', or export --to csv"
        ) from err
    rows = episode.all()
    if rows.data.nbytes > LARGEST_MAT:
        raise ConfigError(
            f"{episode.directory}: {rows.data.nbytes / 1e9:.1f} GB are too much for a MAT file of "
            "level 5; choose --columns, or --to parquet"
        )
    places = _places(rows.columns)
    content = {name: rows[name][:, None] for name in rows.columns}
    packed = io.BytesIO()
    io_module.savemat(
        packed,
        {
            "recording": _nested(content, places),
            "units": _nested(units(rows), places),
        },
        long_field_names=True,
        do_compression=True,
    )
    return packed.getvalue()


def _places(columns: Sequence[str]) -> dict[str, list[str]]:
    """Return each column's way through a structure: by its dots, in names that MATLAB takes.

    A column that others go on from is `value` beside them. What MATLAB would take for the same, or
    not at all, gets another name: an `x` before it, a number after it.
    """
    parts = {name: name.split(".") for name in columns}
    inner = {".".join(way[:k]) for way in parts.values() for k in range(1, len(way))}
    places: dict[str, list[str]] = {}
    known: dict[str, dict[str, str]] = {}
    for name, way in parts.items():
        places[name] = []
        for part in [*way, "value"] if name in inner else way:
            # No part has a dot, so a column's own value is not its child of that name.
            own = f"{part}." if len(places[name]) == len(way) else part
            taken = known.setdefault(".".join(places[name]), {})
            if own not in taken:
                taken[own] = _field(part, taken.values())
            places[name].append(taken[own])
    return places


def _field(part: str, taken: Collection[str]) -> str:
    """Return a name of a field in MATLAB, at most 63 characters, that is not taken."""
    name = re.sub(r"\W", "_", part, flags=re.ASCII)
    name = (name if name[:1].isalpha() else f"x{name}")[:LONGEST]
    numbered = (f"{name}_{k}" for k in itertools.count(2))
    return next(one for one in itertools.chain([name], numbered) if one not in taken)


def _nested(flat: Mapping[str, Any], places: Mapping[str, Sequence[str]]) -> dict[str, Any]:
    """Return a tree of the columns' places."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *way, leaf = places[name]
        branch = tree
        for step in way:
            branch = branch.setdefault(step, {})
        branch[leaf] = value
    return tree


TABLES: dict[str, Callable[[_Rows], bytes | Iterable[bytes]]] = {
    "csv": _csv, "parquet": _parquet, "npz": _npz, "mat": _mat,
}  # fmt: skip
"""What makes the content of a file, by its ending."""
