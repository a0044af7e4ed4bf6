"""Sweeps of many points: same numbers from fewer columns, kill -9, executors, flat memory."""

from __future__ import annotations

import csv
import json
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Iterable
from pathlib import Path
from typing import Any

import pytest
import yaml

from tautwave.analysis.felt import FELT
from tautwave.errors import RecordingError
from tautwave.sweep import file as sweep_file_module
from tautwave.sweep.file import MEASURES, load_sweep
from tautwave.sweep.measure import BOOKS, PREDICTED, measure_run
from tautwave.sweep.pool import MAX_QUEUED_PER_WORKER, Piece, ProcessPool, Worker, in_process
from tautwave.sweep.rows import Simulator, sweep_engine, takes_rows
from tautwave.sweep.runs import run_sweep, table_header
from tautwave.sweep.table import SweepTable, line_of

CONFIGS = Path(__file__).parents[2] / "configs"
WALL = "simulation.environment: {cart: {type: wall, position: 0.0005, stiffness: 500, damping: 1}}"


def sweep(path: Path, *, rows: int = 3, columns: int = 4, duration_s: float = 0.3) -> Path:
    path.write_text(
        f"name: many\nrig: {CONFIGS}/delay-stability.yaml\nduration_s: {duration_s}\n"
        f"set: {{{WALL}}}\n"
        "grid:\n"
        f"  coupling.pairs.cart.wave_impedance: {[5.0 + at for at in range(rows)]}\n"
        f"  simulation.environment.cart.stiffness: {[100.0 + at for at in range(columns)]}\n"
        "measures: [stable, growth_rate, peak_amplitude, position_error_rms, effort_error_max]\n"
    )
    return path


@pytest.mark.parametrize(
    ("rig", "overrides"),
    [
        ("delay-stability", WALL),
        ("bench-2axis-loopback", "seed: 4"),
        ("bench-foam-loopback", "seed: 5"),
        ("bench-multirate-loopback", "coupling.delay_s: 0.04"),
        ("bench-position-coupling", "seed: 6"),
        ("bench-admittance-loopback", "seed: 7"),
    ],
)
def test_few_columns_measure_the_same(tmp_path: Path, rig: str, overrides: str) -> None:
    path = tmp_path / "sweep.yaml"
    path.write_text(
        f"name: a\nrig: {CONFIGS}/{rig}.yaml\nduration_s: 0.6\nset: {{{overrides}}}\n"
        "measures: [stable]\n"
    )
    points = load_sweep(path).points
    whole_rows = {*BOOKS, *FELT}
    wanted = tuple(name for name in MEASURES if name not in {*whole_rows, *PREDICTED})
    assert not takes_rows(wanted)
    found = []
    for whole in (True, False):
        scales, run = Simulator("python", whole=whole)(points, 0)
        measured = measure_run(scales, wanted, run.columns, finished=run.outcome == "finished")
        found.append((run.cycles, run.outcome, [measured[name].hex() for name in wanted]))
    assert found[0] == found[1]
    assert all(takes_rows((name,)) for name in whole_rows)


def ids(path: Path) -> list[str]:
    with path.open(newline="") as file:
        return [row["id"] for row in csv.DictReader(file)]


@pytest.mark.slow
def test_killed_sweep_loses_nothing_and_does_nothing_twice(tmp_path: Path) -> None:
    path = sweep(tmp_path / "sweep.yaml", rows=6, columns=10)
    plan = load_sweep(path)
    whole = run_sweep(plan, tmp_path / "whole")
    for attempt in range(5):  # a test that is held up may find its sweep through
        out = tmp_path / f"out{attempt}"
        workers = killed_sweep(path, out)
        table = out / "points.csv"
        before = ids(table)
        if len(before) < 60:
            break
    assert 4 <= len(before) < 60
    deadline = time.monotonic() + 60.0
    while any(_runs(int(worker)) for worker in workers):  # nobody goes on without it
        assert time.monotonic() < deadline
        time.sleep(0.01)
    kept = table.read_bytes()
    second = run_sweep(plan, out)
    assert second.resumed == len(before)
    assert table.read_bytes() == whole.table.read_bytes()
    assert set(kept.splitlines()) <= set(table.read_bytes().splitlines())


def killed_sweep(path: Path, out: Path) -> list[str]:
    """Kill a sweep once it has written some points; return the numbers of its workers."""
    table = out / "points.csv"
    words = [sys.executable, "-c", "from tautwave.cli import main; main()"]
    words += ["sweep", str(path), "--out", str(out), "--jobs", "2"]
    child = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        deadline = time.monotonic() + 90.0
        while not (table.is_file() and table.read_bytes().count(b"\n") > 4):
            assert time.monotonic() < deadline
            assert child.poll() in (None, 0)
            time.sleep(0.005)
        tree = Path(f"/proc/{child.pid}/task/{child.pid}/children")
        return tree.read_text().split() if tree.is_file() else []
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()


def _runs(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def test_row_by_row_is_as_good_as_any_order(tmp_path: Path) -> None:
    plan = load_sweep(sweep(tmp_path / "sweep.yaml", duration_s=0.02))
    drawn: list[Piece] = []

    def backwards(
        begin: Callable[[], Worker], pieces: Iterable[Piece]
    ) -> Generator[Any, None, None]:
        worker = begin()
        for piece in reversed(list(pieces)):
            drawn.append(piece)
            yield worker(piece)

    plain = run_sweep(plan, tmp_path / "plain")
    other = run_sweep(plan, tmp_path / "other", executor=backwards, jobs=2)
    assert len(drawn) > 1
    assert other.table.read_bytes() == plain.table.read_bytes()


@pytest.mark.slow
def test_pieces_are_drawn_as_they_are_needed() -> None:
    drawn = 0

    def pieces() -> Generator[Piece, None, None]:
        nonlocal drawn
        for at in range(50):
            drawn += 1
            yield at, at + 1

    work = ProcessPool(1)(_echo, pieces())
    first = next(work)
    assert drawn <= MAX_QUEUED_PER_WORKER + 1
    assert sorted([first, *work]) == [(at, at + 1) for at in range(50)]
    assert list(in_process(_echo, [(0, 1)])) == [(0, 1)]


def _echo() -> Worker:
    return _same


def _same(piece: Piece) -> Piece:
    return piece


def test_points_are_as_small_however_many(tmp_path: Path) -> None:
    few = load_sweep(sweep(tmp_path / "few.yaml", rows=4, columns=4)).points
    many = load_sweep(sweep(tmp_path / "many.yaml", rows=400, columns=400)).points
    assert len(many) == 160_000
    assert len(pickle.dumps(many)) < len(pickle.dumps(few)) + 150 * 800
    last = many[-1]
    assert last.values["coupling.pairs.cart.wave_impedance"] == 404.0
    assert last.rig.coupling.pairs["cart"].wave_impedance == 404.0
    assert last.id == many[159_999].id != many[0].id
    with pytest.raises(IndexError):
        many[160_000]


def test_points_that_are_checked_hold_every_value(tmp_path: Path) -> None:
    points = load_sweep(sweep(tmp_path / "sweep.yaml", rows=30, columns=40)).points
    assert list(points.sample(2000)) == list(range(1200))
    chosen = [points.point_id(at).values for at in points.sample(200)]
    assert len(chosen) <= 200
    for key, count in (("wave_impedance", 30), ("stiffness", 40)):
        values = {value for one in chosen for name, value in one.items() if name.endswith(key)}
        assert len(values) == count


def test_a_point_that_is_wrong_is_a_row(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = sweep(tmp_path / "sweep.yaml", rows=2, columns=2, duration_s=0.02)
    path.write_text(path.read_text().replace("[100.0, 101.0]", "[100.0, -1.0]"))
    monkeypatch.setattr(sweep_file_module, "CHECKED", 0)
    plan = load_sweep(path)
    result = run_sweep(plan, tmp_path / "out")
    rows = list(result.rows)
    assert [row["outcome"].partition(":")[0] for row in rows] == ["finished", "refused"] * 2
    assert "greater than 0 (got -1.0)" in rows[1]["outcome"]
    assert rows[1]["growth_rate"] == ""
    assert run_sweep(plan, tmp_path / "out").resumed == 4


def test_two_sweeps_do_not_write_one_table(tmp_path: Path) -> None:
    plan = load_sweep(sweep(tmp_path / "sweep.yaml", duration_s=0.02))
    (tmp_path / "out").mkdir()
    header = table_header(plan)
    with (
        SweepTable(tmp_path / "out/points.csv", header, plan.points.ids()),
        pytest.raises(RecordingError, match="another sweep is writing to it"),
    ):
        run_sweep(plan, tmp_path / "out")


def test_cells_keep_their_commas() -> None:
    line = line_of(["a", "b", "c"], {"a": 'say "x", y', "c": "1"})
    assert next(csv.reader([line])) == ['say "x", y', "", "1"]


def test_a_small_sweep_needs_no_compiler() -> None:
    assert sweep_engine(1000) == "python"
    assert sweep_engine(10**9) in ("compiled", "python")


@pytest.mark.slow
def test_shipped_hundred_thousand_walls(tmp_path: Path) -> None:
    """The whole of it takes minutes; here are its corners, for a moment each."""
    shipped = CONFIGS / "sweeps/many-walls.yaml"
    plan = load_sweep(shipped)
    assert len(plan.points) == 100_000
    assert len(set(plan.points.ids().tolist())) == 100_000
    rig = plan.points[0].rig
    assert (rig.rate_hz, rig.duration_s) == (1000, 10)
    found = plan.points.family(12_345)
    assert found is not None
    assert len(found[0].keys) == 3  # nothing of the rig is read twice
    cut: dict[str, Any] = yaml.safe_load(shipped.read_text())
    cut["rig"] = str(CONFIGS / "bench-1dof-loopback.yaml")
    cut["duration_s"] = 0.9
    cut["grid"] = {key: [values[0], values[-1]] for key, values in cut["grid"].items()}
    path = tmp_path / "cut.yaml"
    path.write_text(json.dumps(cut))
    rows = list(run_sweep(load_sweep(path), tmp_path / "out").rows)
    assert len(rows) == 8
    assert {row["outcome"] for row in rows} == {"finished"}
    # Where the wall is reached its stiffness tells; 0.9 s of the hand's way do for the near one.
    errors = [row["effort_error_max"] for row in rows]
    assert errors[0] != errors[2]
    assert errors[4] != errors[6]
    assert errors[5] == errors[7]
