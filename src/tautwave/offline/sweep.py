"""Many closed-loop simulations: points of a sweep to rows of a table, here or in a pool.

Rows are appended to `points.csv` as they come and are flushed, so whatever ends a sweep leaves
what was done, and the same sweep into the same directory goes on from there. At the end the file
is put into the order of the sweep.
"""

from __future__ import annotations

import csv
import json
import os
import signal
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from contextlib import suppress
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.errors import RecordingError
from tautwave.offline.sweep_file import Point, SweepPlan
from tautwave.offline.sweep_measure import measure_point
from tautwave.offline.sweep_rows import simulate_rows

TABLE = "points.csv"
CHUNKS = 32
"""Pieces per worker: enough to share the work evenly, few enough to cost nothing."""

Row = dict[str, str]


class SweepResult(NamedTuple):
    """How a sweep went: rows in the sweep's order, all points asked for, points taken over."""

    rows: list[Row]
    total: int
    resumed: int
    interrupted: bool
    table: Path


def run_sweep(
    plan: SweepPlan,
    out: Path,
    *,
    jobs: int = 1,
    progress: Callable[[float, str], None] | None = None,
) -> SweepResult:
    """Simulate every point that `out` does not hold yet.

    Parameters
    ----------
    plan : SweepPlan
        From `load_sweep`.
    out : Path
        Directory of the table; made if needed.
    jobs : int
        Processes; 1 simulates in this one.
    progress : callable, optional
        Called now and then with the share done and a word.

    Raises
    ------
    RecordingError
        The directory holds another sweep, or cannot be written.
    """
    header = table_header(plan)
    table = out / TABLE
    known = {point.id for point in plan.points}
    try:
        out.mkdir(parents=True, exist_ok=True)
        rows = read_table(table, header, known)
        _write_table(table, header, rows.values())
        resumed = len(rows)
        left = [point for point in plan.points if point.id not in rows]
        interrupted = False
        with table.open("a", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, header, lineterminator="\n")
            work = _serial(plan, left) if jobs <= 1 else _pooled(plan, left, jobs)
            try:
                for done in work:
                    writer.writerows(done)
                    file.flush()
                    rows.update({row["id"]: row for row in done})
                    if progress is not None:
                        progress(len(rows) / len(plan.points), "simulating")
            except KeyboardInterrupt:
                interrupted = True
            finally:
                work.close()
        ordered = [rows[point.id] for point in plan.points if point.id in rows]
        _write_table(table, header, ordered)
    except OSError as err:
        if isinstance(err, RecordingError):
            raise
        raise RecordingError(f"{out}: the sweep cannot be written: {err.strerror}") from err
    return SweepResult(ordered, len(plan.points), resumed, interrupted, table)


def table_header(plan: SweepPlan) -> list[str]:
    """Return the columns of a sweep's table."""
    return ["id", "case", *plan.keys, "outcome", "cycles", *plan.sweep.measures]


def read_table(path: Path, header: Sequence[str], known: set[str]) -> dict[str, Row]:
    """Return the rows of an unfinished table by id; none where there is no table.

    A last line that was cut off is left out.

    Raises
    ------
    RecordingError
        The table is that of another sweep.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return {}
    except UnicodeDecodeError as err:
        raise RecordingError(f"{path}: not a table of this sweep; give a new --out") from err
    lines = text[: text.rfind("\n") + 1].splitlines()
    if not lines:
        return {}
    reader = csv.reader(lines)
    if next(reader) != list(header):
        raise RecordingError(
            f"{path}: has other columns than this sweep; give a new --out, or remove it first"
        )
    rows = [dict(zip(header, cells, strict=True)) for cells in reader if len(cells) == len(header)]
    foreign = sum(row["id"] not in known for row in rows)
    if foreign:
        raise RecordingError(
            f"{path}: {foreign} of its {len(rows)} points are not in this sweep (file or rig was "
            "changed); give a new --out, or remove it first"
        )
    return {row["id"]: row for row in rows}


def _write_table(path: Path, header: Sequence[str], rows: Any) -> None:
    """Replace the table as a whole, or not at all."""
    part = path.with_suffix(".part")
    with part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, header, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    os.replace(part, path)


def simulate_point(plan_keys: Sequence[str], wanted: tuple[str, ...], point: Point) -> Row:
    """Simulate and measure one point; return its row as text."""
    columns, cycles, outcome = simulate_rows(point.rig, point.duration_s)
    measured = measure_point(point, wanted, columns, finished=outcome == "finished")
    row: Row = {"id": point.id, "case": point.case, "outcome": outcome, "cycles": str(cycles)}
    for key in plan_keys:
        value = point.values.get(key, "")
        row[key] = value if isinstance(value, str) else json.dumps(value)
    row.update({name: repr(value) for name, value in measured.items()})
    return row


def _serial(plan: SweepPlan, points: Sequence[Point]) -> Generator[list[Row]]:
    for point in points:
        yield [simulate_point(plan.keys, plan.sweep.measures, point)]


def _chunk(keys: Sequence[str], wanted: tuple[str, ...], points: Sequence[Point]) -> list[Row]:
    return [simulate_point(keys, wanted, point) for point in points]


def _ignore_interrupts() -> None:
    """Ctrl-C belongs to the process that hands out the work."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(OSError):
        os.nice(5)


def _pooled(plan: SweepPlan, points: Sequence[Point], jobs: int) -> Generator[list[Row]]:
    """Simulate chunks of points in a pool; what was begun is waited for and kept, never killed."""
    size = max(1, len(points) // (jobs * CHUNKS))
    chunks = [points[at : at + size] for at in range(0, len(points), size)]
    pool = ProcessPoolExecutor(
        min(jobs, max(1, len(chunks))), get_context("spawn"), initializer=_ignore_interrupts
    )
    try:
        waiting: set[Future[list[Row]]] = {
            pool.submit(_chunk, plan.keys, plan.sweep.measures, chunk) for chunk in chunks
        }
        while waiting:
            done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()
    except KeyboardInterrupt:
        pool.shutdown(cancel_futures=True)
        yield [
            row
            for future in waiting
            if future.done() and not future.cancelled()
            for row in future.result()
        ]
        raise
    finally:
        pool.shutdown(cancel_futures=True)
