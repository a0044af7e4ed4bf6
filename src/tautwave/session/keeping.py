"""The directory of a run: created at its start, removed again if nothing ever moved."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tautwave.files import make_directory

VALUE_BYTES = 8
"""A recorded number; compression of chunks makes it less."""


@contextmanager
def run_directory(directory: Path) -> Iterator[Callable[[], None]]:
    """Make a run's directory for the block; yield a function that keeps it.

    Unless that was called, the directory is removed when the block raises: a refused run leaves
    nothing behind.

    Raises
    ------
    WritingError
        It cannot be made.
    """
    made = [path for path in (directory, *directory.parents) if not path.exists()]
    make_directory(directory)
    there = set(directory.iterdir())
    kept: list[bool] = []
    try:
        yield lambda: kept.append(True)
    except BaseException:
        if not kept:
            _forget(directory, there, made)
        raise


def warn_of_little_room(
    directory: Path, rows: float, columns: int, warn: Callable[[str], None] | None
) -> None:
    """Warn before anything moves where a whole recording may not fit: it would end early.

    Parameters
    ----------
    directory : Path
        The run's.
    rows : float
        Of the whole run.
    columns : int
        Of a row.
    warn : callable, optional
        Takes the sentence.
    """
    if warn is None:
        return
    with suppress(OSError):
        most, free = rows * columns * VALUE_BYTES, shutil.disk_usage(directory).free
        if most > free:
            warn(
                f"{directory}: {free * 1e-6:.3g} MB free, and the recording may take up to "
                f"{most * 1e-6:.3g} MB: on a full disk it ends before the run; free some, give "
                "--out on another disk, or a shorter --duration"
            )


def _forget(directory: Path, there: set[Path], made: list[Path]) -> None:
    with suppress(OSError):
        for entry in set(directory.iterdir()) - there:
            if entry.is_dir():
                shutil.rmtree(entry)
            else:
                entry.unlink()
        for folder in made:
            folder.rmdir()
