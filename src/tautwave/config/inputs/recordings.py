"""Recorded references: find the file and check that it has the named columns."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from tautwave.config.keys.common import Block
from tautwave.config.text.document import Document, nearest, show_path
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError, RecordingError
from tautwave.recordings import DIRECTORIES
from tautwave.recordings.stated import stated_in


def find_recording(document: Document, path: KeyPath, file: str) -> Path | None:
    """Return the absolute path of a recording, None if there is none.

    A relative path is resolved against the rig file's directory; one given with `--set` is
    tried in the current folder first, where the shell completes it.
    """
    for candidate in _candidates(document, path, file):
        try:
            if candidate.is_file() or any((candidate / mark).is_file() for mark in DIRECTORIES):
                return candidate.resolve()
        except (OSError, ValueError):
            continue
    return None


def require_file(document: Document, at: KeyPath, file: str) -> Path | None:
    """Return what `find_recording` does, and note a file that is not there."""
    existing = find_recording(document, at, file)
    if existing is None:
        places = dict.fromkeys(str(c.absolute()) for c in _candidates(document, at, file))
        tried = " and ".join(places)
        document.report(
            at, f"no such file (tried {tried}); give another with --set {show_path(at)}=PATH"
        )
    return existing


def check_recording(
    document: Document, path: KeyPath, recording: Block, keys: Sequence[str]
) -> None:
    """Note a recording, the `file` of a block, that does not exist or lacks a column of `keys`."""
    at = (*path, "file")
    existing = require_file(document, at, recording.file)  # type: ignore[attr-defined]
    if existing is None:
        return
    from tautwave.recordings.columns import column_names  # not to import NumPy for every rig

    try:
        columns = column_names(existing, stated_in(recording))
    except (ConfigError, RecordingError) as err:
        document.report(at, str(err).removeprefix(f"{existing}: "))
        return
    for key in keys:
        wanted = getattr(recording, key)
        if wanted is not None and wanted not in columns:
            document.report(
                (*path, key) if document.get((*path, key)) is not None else at,
                f"{existing.name} has no column {wanted!r}{nearest(wanted, columns) or '.'} "
                f"It has: {', '.join(columns[:12])}{', ...' if len(columns) > 12 else ''}",
            )


def _candidates(document: Document, path: KeyPath, file: str) -> list[Path]:
    given = Path(file)
    if given.is_absolute():
        return [given]
    folder = document.folder / given
    return [given, folder] if document.mark(path).argument is not None else [folder]
