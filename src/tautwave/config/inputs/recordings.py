"""Recorded references: find the file and check that it has the named columns."""

from __future__ import annotations

import csv
from pathlib import Path

from tautwave.config.keys.simulation import Recording
from tautwave.config.text.document import Document, nearest, show_path
from tautwave.config.text.yaml12 import KeyPath


def find_recording(document: Document, path: KeyPath, file: str) -> Path | None:
    """Return the absolute path of a recording, None if there is none.

    A relative path starts at the rig file's folder; one given with `--set` is tried in the current
    folder first, where the shell completes it.
    """
    for candidate in _candidates(document, path, file):
        try:
            if candidate.is_file():
                return candidate.resolve()
        except (OSError, ValueError):
            continue
    return None


def check_recording(document: Document, path: KeyPath, recording: Recording) -> None:
    """Note a recording that does not exist or lacks a column; `path` is the reference's."""
    at = (*path, "file")
    found = find_recording(document, at, recording.file)
    if found is None:
        tried = " and ".join(str(c.absolute()) for c in _candidates(document, at, recording.file))
        document.report(
            at, f"no such file (tried {tried}); give another with --set {show_path(at)}=PATH"
        )
        return
    try:
        with found.open(encoding="utf-8-sig", newline="") as stream:
            heading = next(csv.reader([stream.readline(1 << 16)]), [])
    except (OSError, ValueError, csv.Error) as err:
        document.report(at, f"cannot be read as CSV text: {err}")
        return
    columns = [column.strip() for column in heading]
    for key, wanted in (("column", recording.column), ("time_column", recording.time_column)):
        if wanted not in columns:
            document.report(
                (*path, key) if document.get((*path, key)) is not None else at,
                f"{found.name} has no column {wanted!r}{nearest(wanted, columns) or '.'} "
                f"It has: {', '.join(columns[:12])}{', ...' if len(columns) > 12 else ''}",
            )


def _candidates(document: Document, path: KeyPath, file: str) -> list[Path]:
    given = Path(file)
    if given.is_absolute():
        return [given]
    folder = document.folder / given
    return [given, folder] if document.mark(path).argument is not None else [folder]
