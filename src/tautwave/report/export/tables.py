"""A run as tables, one file an episode: CSV, Parquet, NumPy's npz or MATLAB's mat. SI units."""

from __future__ import annotations

import csv
import importlib
import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tautwave.errors import ConfigError
from tautwave.files import make_directory, write_bytes, write_text
from tautwave.recordings.recording import Recording, read_recording
from tautwave.report.export.episodes import episodes, units

INDEX = ("file", "number", "name", "task", "success", "begin_s", "end_s", "rows")


def export_tables(
    directory: Path, to: str, out: Path, columns: Sequence[str] | None = None
) -> list[Path]:
    """Write the episodes of a run into `out`, and `episodes.csv`, which lists them.

    A run without episodes is one file, `run`. `time_s` and all other columns are as recorded.

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
    found = list(episodes(directory))  # before a folder is made for what is not there
    if out.suffix == f".{to}":
        raise ConfigError(f"{out}: tables go into a directory, one for each episode; name that")
    paths = [out / f"{episode.stem}.{to}" for episode in found]
    there = next(filter(Path.exists, paths), None)
    if there is not None:
        raise ConfigError(f"{there} exists; choose another --out, or remove it first")
    read_recording(directory, columns, rows=slice(0, 1))  # an unknown column leaves no directory
    make_directory(out)
    written, lines = [], []
    for episode, path in zip(found, paths, strict=True):
        rows = read_recording(directory, columns, rows=episode.rows)
        times = read_recording(directory, ["time_s"], rows=episode.rows).time_s
        write_bytes(path, content(rows, units(rows.columns, rows.attachments)))
        written.append(path)
        success = "" if episode.success is None else str(episode.success).lower()
        ends = [f"{times[0]:.9g}", f"{times[-1]:.9g}"] if len(times) else ["", ""]
        named = [path.name, episode.number, episode.name, episode.task]
        lines.append([*named, success, *ends, len(rows)])
    index = io.StringIO()
    csv.writer(index, lineterminator="\n").writerows([INDEX, *lines])
    write_text(out / "episodes.csv", index.getvalue())
    return [*written, out / "episodes.csv"]


def _csv(rows: Recording, units: dict[str, str]) -> bytes:
    del units  # a heading of names only is what every reader of CSV takes
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(rows.columns)
    writer.writerows(row.tolist() for row in rows.data)
    return text.getvalue().encode("utf-8")


def _npz(rows: Recording, units: dict[str, str]) -> bytes:
    del units  # an array of npz has no place for one
    packed = io.BytesIO()
    arrays: dict[str, Any] = {name: rows[name] for name in rows.columns}
    np.savez_compressed(packed, **arrays)
    return packed.getvalue()


def _parquet(rows: Recording, units: dict[str, str]) -> bytes:
    table = rows.to_arrow()
    fields = [
        field.with_metadata({"unit": units[field.name]}) if field.name in units else field
        for field in table.schema
    ]
    schema = importlib.import_module("pyarrow").schema(fields, table.schema.metadata)
    packed = io.BytesIO()
    importlib.import_module("pyarrow.parquet").write_table(table.cast(schema), packed)
    return packed.getvalue()


def _mat(rows: Recording, units: dict[str, str]) -> bytes:
    """Return a MAT file, level 5: `recording`, a structure by the dots of names, and `units`."""
    try:
        io_module = importlib.import_module("scipy.io")
    except ImportError as err:
        raise ConfigError(
            "--to mat needs SciPy: pip install 'tautwave[analysis]', or export --to csv"
        ) from err
    tree = _nested({name: rows[name][:, None] for name in rows.columns})
    packed = io.BytesIO()
    io_module.savemat(
        packed,
        {"recording": tree, "units": _nested(units)},
        long_field_names=True,
        do_compression=True,
    )
    return packed.getvalue()


def _nested(flat: dict[str, Any]) -> dict[str, Any]:
    """Return a tree by the dots of the names; a name beside longer ones of its own is `value`."""
    tree: dict[str, Any] = {}
    for name in sorted(flat, key=lambda one: one.count("."), reverse=True):
        *way, leaf = name.replace("-", "_").split(".")
        branch = tree
        for step in way:
            branch = branch.setdefault(step, {})
        if leaf in branch:
            branch[leaf]["value"] = flat[name]
        else:
            branch[leaf] = flat[name]
    return tree


TABLES: dict[str, Callable[[Recording, dict[str, str]], bytes]] = {
    "csv": _csv, "parquet": _parquet, "npz": _npz, "mat": _mat,
}  # fmt: skip
"""What makes the content of a file, by its ending."""
