"""Many closed-loop simulations: points of a sweep to rows of a table, in this or other processes.

Rows are appended to `points.csv` as they finish, so an interrupted sweep keeps them, and the same
sweep into the same directory resumes. At the end the file is sorted into the order of the sweep.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from tautwave.errors import ConfigError, RecordingError, WritingError
from tautwave.rig import coupling_law
from tautwave.simulation.run import simulate
from tautwave.sweep.file import SweepPlan
from tautwave.sweep.measure import PREDICTED, measure_run, predict_pair
from tautwave.sweep.parquet import column_types, origin, write_parquet
from tautwave.sweep.points import Points
from tautwave.sweep.pool import Executor, Piece, ProcessPool, in_process
from tautwave.sweep.rows import Simulator, sweep_engine, takes_rows
from tautwave.sweep.table import SweepTable, TableRows, line_of

TABLE = "points.csv"
LARGEST = 64
"""Most points of a piece, so that each row reaches the disk within tenths of a second."""

STEPS = 1_000_000
"""Most steps of a piece, unless a single point has more."""


class SweepResult(NamedTuple):
    """Result of a sweep: rows in the sweep's order, total number of points, points resumed."""

    rows: TableRows
    total: int
    resumed: int
    interrupted: bool
    table: Path
    parquet: Path | None


class Finished(NamedTuple):
    """A finished piece: indices of its points, and their lines."""

    numbers: range
    text: str


def run_sweep(
    plan: SweepPlan,
    out: Path,
    *,
    jobs: int = 1,
    executor: Executor | None = None,
    engine: str | None = None,
    progress: Callable[[float, str], None] | None = None,
) -> SweepResult:
    """Simulate every point that is not yet in `out`.

    Parameters
    ----------
    plan : SweepPlan
        From `load_sweep`.
    out : Path
        Directory of the table; created if needed.
    jobs : int
        Processes; 1 simulates in this one.
    executor : Executor, optional
        Runs the pieces, instead of `jobs` processes.
    engine : str, optional
        Of `simulate`; by default the fastest available, plain Python for a small sweep.
    progress : callable, optional
        Called now and then with the fraction done of the remaining points, and a short text.

    Raises
    ------
    RecordingError
        The directory holds another sweep.
    WritingError
        It cannot be written.
    """
    header = table_header(plan)
    path = out / TABLE
    points = plan.points
    total = len(points)
    cycles = _cycles(plan)
    try:
        out.mkdir(parents=True, exist_ok=True)
        with SweepTable(path, header, points.ids()) as table:
            resumed = done = int(table.done.sum())
            here = executor is None and jobs <= 1  # where Ctrl-C costs only the piece in progress
            size = max(1, min(LARGEST, STEPS // cycles, (total - done) // (4 * jobs)))
            size = 1 if here else size
            pieces = list(_pieces(table.done.tolist(), size))
            name = engine or sweep_engine((total - done) * cycles)
            begin = functools.partial(_Piecework, points, header, plan.sweep.measures, name)
            run = executor or (in_process if here else ProcessPool(min(jobs, len(pieces))))
            if name == "compiled" and pieces and executor is None:
                _compile_once(plan, progress)
            interrupted = False
            left = total - resumed  # resumed points do not count towards the time left
            word = f"simulating the remaining {left} points" if resumed else "simulating"
            work = run(begin, pieces) if pieces else None
            try:
                for finished in work or ():
                    table.append(*finished)
                    done += len(finished.numbers)
                    if progress is not None:
                        progress((done - resumed) / left, word)
            except KeyboardInterrupt:
                interrupted = True
            finally:
                if work is not None:
                    work.close()
            table.put_in_order()
    except OSError as err:
        if isinstance(err, RecordingError):
            raise
        raise WritingError(f"{out}: the sweep cannot be written: {err.strerror}") from err
    parquet = None
    if not interrupted:
        parquet = write_parquet(path, column_types(plan, header), origin(plan))
    return SweepResult(TableRows(path, done), total, resumed, interrupted, path, parquet)


def _compile_once(plan: SweepPlan, progress: Callable[[float, str], None] | None) -> None:
    """Compile before there are workers, each of which would; nothing where the cache has it."""
    from tautwave.simulation.kernel.compiled import is_cached
    from tautwave.simulation.kernel.run import run_law

    for first in plan.points.firsts():
        try:
            rig = plan.points[first].rig
        except ConfigError:
            continue  # the worker reports it in the point's row
        if is_cached(run_law, coupling_law(rig)):
            continue
        if progress is not None:
            progress(0.0, "compiling for half a minute a law, once per machine and version")
        simulate(rig, duration_s=2.0 * rig.period_s)


def _cycles(plan: SweepPlan) -> int:
    """Return the cycles of the first point, as an estimate for all."""
    try:
        point = plan.points[0]
    except ConfigError:
        return 1
    return max(1, round(point.duration_s * point.rig.rate_hz))


def _pieces(done: Sequence[bool], size: int) -> Iterator[Piece]:
    """Yield ranges of unfinished points, of at most `size`."""
    start = 0
    while start < len(done):
        if done[start]:
            start += 1
            continue
        end = start
        while end < len(done) and end - start < size and not done[end]:
            end += 1
        yield start, end
        start = end


def table_header(plan: SweepPlan) -> list[str]:
    """Return the columns of a sweep's table."""
    return ["id", "case", *plan.keys, "outcome", "cycles", *plan.sweep.measures]


class _Piecework:
    """A worker: simulates the points of a piece and returns their lines."""

    def __init__(
        self, points: Points, header: Sequence[str], wanted: tuple[str, ...], engine: str
    ) -> None:
        self._points = points
        self._header = header
        self._wanted = wanted
        self._simulate = Simulator(engine, whole=takes_rows(wanted))

    def __call__(self, piece: Piece) -> Finished:
        numbers = range(*piece)
        rows = (
            simulate_point(self._points, number, self._wanted, self._simulate) for number in numbers
        )
        lines = [line_of(self._header, row) for row in rows]
        return Finished(numbers, "".join(lines))


def simulate_point(
    points: Points, number: int, wanted: tuple[str, ...], simulate: Simulator
) -> dict[str, str]:
    """Simulate and measure one point; return its row as text.

    An invalid rig also gives a row: its outcome says why.
    """
    row = points.row(number)
    try:
        scales, run = simulate(points, number)
        measured = measure_run(scales, wanted, run.columns, finished=run.outcome == "finished")
        if any(name in PREDICTED for name in wanted):
            measured |= predict_pair(points.rig(number), scales.pair)
    except ConfigError as err:
        return {**row, "outcome": f"refused: {err}", "cycles": "0"}
    row.update(outcome=run.outcome, cycles=str(run.cycles))
    row.update({name: repr(measured[name]) for name in wanted})
    return row
