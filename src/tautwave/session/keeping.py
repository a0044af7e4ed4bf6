"""The directory of a run: created at its start, removed again if nothing ever moved."""

from __future__ import annotations

import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from tautwave.files import make_directory

PROBE_S, PROBE_BYTES = 1.0, 1 << 18
"""A disk is tried with so much of a recording [s], for no longer, and by so many bytes at once."""
MAX_BACKLOG = 0.5
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


def warn_of_slow_disk(
    directory: Path,
    bytes_per_s: float,
    warn: Callable[[str], None] | None,
    now: Callable[[], float] = time.perf_counter,
) -> None:
    """Warn before anything moves where the disk takes rows more slowly than a run makes them.

    A part of a second of the recording is written there, forced out, and removed again.

    Parameters
    ----------
    directory : Path
        The run's.
    bytes_per_s : float
        What the run records.
    warn : callable, optional
        Takes the sentence.
    now : callable, optional
        Time [s].
    """
    if warn is None:
        return
    wanted, done, began = PROBE_S * bytes_per_s, 0, now()
    try:
        with tempfile.TemporaryFile(dir=directory, buffering=0) as file:
            while done < wanted and now() - began < PROBE_S:
                done += file.write(os.urandom(PROBE_BYTES))
                os.fsync(file.fileno())
        spent = now() - began
    except OSError:
        return  # the recording itself will say why
    taken = done / spent if spent > 0.0 else math.inf
    if taken < bytes_per_s:
        warn(
            f"{directory}: the disk takes {taken * 1e-6:.3g} MB/s (measured), and the run records "
            f"up to {bytes_per_s * 1e-6:.3g} MB/s: rows may be lost; give --out on another disk"
        )


def backlog_warning(
    share: Callable[[], float], warn: Callable[[str], None] | None
) -> Callable[[], None]:
    """Return a function that warns, once, when rows wait for the disk while a run goes on.

    `share` of the rows that may wait do.
    """
    warned: list[bool] = []

    def look() -> None:
        if warn is not None and not warned and share() > MAX_BACKLOG:
            warned.append(True)
            warn(
                "the disk is slower than the run: half of the rows that may wait for it do, and "
                "the next ones are soon lost; stop, and give --out on another disk"
            )

    return look


def _forget(directory: Path, there: set[Path], made: list[Path]) -> None:
    with suppress(OSError):
        for entry in set(directory.iterdir()) - there:
            if entry.is_dir():
                shutil.rmtree(entry)
            else:
                entry.unlink()
        for folder in made:
            folder.rmdir()
