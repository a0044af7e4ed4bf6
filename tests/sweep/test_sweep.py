"""Sweep files, their mistakes, and tables that survive an interruption."""

from __future__ import annotations

import csv
import json
import signal
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import ConfigError, RecordingError
from tautwave.report.figures.sweep import write_sweep_figure
from tautwave.simulation.kernel import compiled
from tautwave.sweep import runs as sweep_module
from tautwave.sweep.file import load_sweep
from tautwave.sweep.runs import run_sweep, table_header

ROOT = Path(__file__).parents[2]
RIG = ROOT / "configs/delay-stability.yaml"

GOOD = f"""\
name: small
rig: {RIG}
duration_s: 0.05
set: {{rate_hz: 1000}}
cases:
  wave:
    label: wave line
    grid: {{coupling.pairs.cart.wave_impedance: [5, 10]}}
  position:
    set: {{coupling.law: position, coupling.pairs.cart: {{stiffness: 1, damping: 10}}}}
    columns:
      coupling.pairs.cart.stiffness: [500, 250]
      coupling.pairs.cart.damping: [10, 20]
grid:
  coupling.delay_s: [0.001, 0.002]
measures: [predicted_growth, growth_rate, stable, position_error_rms, residual, generated]
figure:
  title: small
  x: coupling.delay_s
  label: delay [s]
  panels:
    - {{measures: [predicted_growth, growth_rate], label: "growth [1/s]", mark_stability: true}}
    - {{measures: [position_error_rms], label: "error [m]", scale: log}}
"""


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def write(text: str) -> Path:
        path = tmp_path / "sweep.yaml"
        path.write_text(text)
        return path

    return write


def problems(path: Path) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load_sweep(path)
    return [text.replace(f"{path}:", "") for text in caught.value.problems]


def test_points_are_cases_times_grid_times_rows(write: Callable[[str], Path]) -> None:
    plan = load_sweep(write(GOOD))
    assert len(plan.points) == 8
    assert len({point.id for point in plan.points}) == 8
    assert [point.case for point in plan.points] == ["wave"] * 4 + ["position"] * 4
    last = plan.points[-1]
    assert last.values == {
        "coupling.delay_s": 0.002,
        "coupling.pairs.cart.stiffness": 250,
        "coupling.pairs.cart.damping": 20,
    }
    assert last.rig.coupling.pairs["cart"].stiffness == 250
    assert last.rig.delay_samples == 2
    assert last.duration_s == 0.05
    assert len({point.rig.seed for point in plan.points}) == 8


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("measures: [p", "measure: [p", "unknown key 'measure'; did you mean 'measures'?"),
        ("growth_rate, stable", "growth, stable", "Input should be 'peak_amplitude'"),
        ("[500, 250]", "[500, 250, 100]", "as many values as coupling.pairs.cart.stiffness"),
        ("x: coupling.delay_s", "x: coupling.delay", "case wave does not vary 'coupling.delay'"),
        ("[5, 10]", "[]", "at least 1 item"),
        ("[0.001, 0.002]", "[0.001, 0.0015]", "grid.coupling.delay_s.1"),
        ("[5, 10]", "[5, -10]", "Input should be 'auto' or a number greater than 0"),
        ("wave_impedance: [5", "wave_impedence: [5", "unknown key 'wave_impedence'"),
        ("growth_rate, stable,", "stable,", "'growth_rate' is not measured; add it to measures"),
        ("duration_s: 0.05", "duration_s: -1", "Input should be greater than 0"),
        ("duration_s: 0.05", "pair: kart", "unknown pair 'kart'; did you mean 'cart'?"),
        ("{rate_hz: 1000}", "{coupling.delay_s: 0.5}\nseed: 3", "unknown key 'seed'"),
        ("[10, 20]", "[10, 20]\n    grid: {coupling.delay_s: [1]}", "is already varied by grid"),
        (str(RIG), "nowhere.yaml", "nowhere.yaml: no such file"),
        (str(RIG), str(ROOT / "configs/bench-admittance-loopback.yaml"), "rate_hz"),
    ],
)
def test_mistakes_are_reported_with_their_line(
    write: Callable[[str], Path], old: str, new: str, expected: str
) -> None:
    if old == str(RIG) and "admittance" in new:
        text = f"name: a\nrig: {new}\nmeasures: [predicted_radius]\ngrid: {{rate_hz: [1000, x]}}\n"
    else:
        assert GOOD.count(old) >= 1
        text = GOOD.replace(old, new, 1)
    found = problems(write(text))
    assert any(expected in text for text in found), found


def test_all_mistakes_at_once_each_once(write: Callable[[str], Path]) -> None:
    text = GOOD.replace("[5, 10]", "[5, -10]").replace("[500, 250]", "[500, many]")
    found = problems(write(text))
    assert len(found) == 2
    assert found[0].startswith("8: cases.wave.grid.coupling.pairs.cart.wave_impedance.1: ")
    assert found[1].startswith("12: cases.position.columns.coupling.pairs.cart.stiffness.1: ")


def test_admittance_has_no_prediction(write: Callable[[str], Path]) -> None:
    rig = ROOT / "configs/bench-admittance-loopback.yaml"
    found = problems(write(f"name: a\nrig: {rig}\nmeasures: [residual, predicted_radius]\n"))
    assert len(found) == 1
    assert "predicted_radius is for impedance axes" in found[0]


def test_a_sweep_that_is_no_mapping_is_called_a_sweep(write: Callable[[str], Path]) -> None:
    assert "a sweep file must be a mapping" in problems(write("- 1\n"))[0]


def cells(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_table_and_figure(write: Callable[[str], Path], tmp_path: Path) -> None:
    plan = load_sweep(write(GOOD))
    heard: list[float] = []
    result = run_sweep(plan, tmp_path / "out", progress=lambda share, _: heard.append(share))
    assert heard[-1] == 1.0
    assert not result.interrupted
    rows = cells(result.table)
    assert rows == list(result.rows)
    assert list(rows[0]) == table_header(plan)
    assert [row["id"] for row in rows] == [point.id for point in plan.points]
    assert rows[0]["coupling.pairs.cart.stiffness"] == ""
    for row in rows:
        assert row["outcome"] == "finished"
        assert row["cycles"] == "50"
        assert float(row["residual"]) < 1e-14
    picture = write_sweep_figure(plan.sweep, list(result.rows), tmp_path)
    assert picture is not None
    assert struct.unpack(">I", picture.read_bytes()[16:20]) == (1000,)


class Stopped:
    """A simulation that Ctrl-C ends after some points."""

    def __init__(self, after: int) -> None:
        self.left = after
        self.real = sweep_module.simulate_point

    def __call__(self, *arguments: Any) -> Any:
        if self.left == 0:
            raise KeyboardInterrupt
        self.left -= 1
        return self.real(*arguments)


def test_interrupted_sweep_goes_on_where_it_stopped(
    write: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = load_sweep(write(GOOD))
    whole = run_sweep(plan, tmp_path / "whole")
    out = tmp_path / "out"
    with monkeypatch.context() as patch:
        patch.setattr(sweep_module, "simulate_point", Stopped(3))
        first = run_sweep(plan, out)
    assert first.interrupted
    assert len(cells(first.table)) == 3
    with first.table.open("a") as file:
        file.write(f"{plan.points[3].id},wave,0.0")  # killed in the middle of a line
    stub = Stopped(5)  # the other five, and none twice
    monkeypatch.setattr(sweep_module, "simulate_point", stub)
    heard: list[tuple[float, str]] = []
    second = run_sweep(plan, out, progress=lambda *reported: heard.append(reported))
    assert (second.resumed, second.interrupted, stub.left) == (3, False, 0)
    # A bar that began at 3 of 8 would think that it is quick.
    assert heard[0] == (0.2, "simulating the remaining 5 points")
    assert heard[-1][0] == 1.0
    assert second.table.read_text() == whole.table.read_text()
    third = run_sweep(plan, out)
    assert third.resumed == 8


def test_a_compile_is_announced_before_it_begins(
    write: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the points are simulated in this process, one after the other."""
    done: list[str] = []

    def progress(_: float, said: str) -> None:
        done.append(said)
        raise RuntimeError

    monkeypatch.setattr(compiled, "is_cached", lambda *_: False)
    monkeypatch.setattr(sweep_module, "simulate", lambda *_, **__: done.append("compiled"))
    with pytest.raises(RuntimeError):
        run_sweep(load_sweep(write(GOOD)), tmp_path / "out", engine="compiled", progress=progress)
    assert done == ["compiling for half a minute a law, once per machine and version"]


@pytest.mark.slow
def test_pool_gives_the_same_table(write: Callable[[str], Path], tmp_path: Path) -> None:
    plan = load_sweep(write(GOOD))
    serial = run_sweep(plan, tmp_path / "serial")
    pooled = run_sweep(plan, tmp_path / "pooled", jobs=2)
    assert pooled.table.read_text() == serial.table.read_text()


def test_another_sweep_is_not_overwritten(write: Callable[[str], Path], tmp_path: Path) -> None:
    plan = load_sweep(write(GOOD))
    run_sweep(plan, tmp_path / "out")
    before = (tmp_path / "out/points.csv").read_text()
    for old, new in (("[5, 10]", "[5, 11]"), ("stable, position_error_rms", "stable")):
        text = GOOD.replace(old, new)
        if "rms" in old:
            text = text.replace("[position_error_rms], l", "[stable], l")
        with pytest.raises(RecordingError, match="give a new --out"):
            run_sweep(load_sweep(write(text)), tmp_path / "out")
    assert (tmp_path / "out/points.csv").read_text() == before


def test_command_writes_table_and_picture(write: Callable[[str], Path], tmp_path: Path) -> None:
    path, out = write(GOOD), tmp_path / "out"
    words = ["sweep", str(path), "--out", str(out), "--jobs", "1"]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "small: 8 of 8 points; every bus simulated in memory" in done.stdout
    assert str(out / "sweep.png") in done.stdout
    again = CliRunner().invoke(main, [*words, "--json"])
    reported = json.loads(again.stdout)
    assert (reported["done"], reported["resumed"], reported["interrupted"]) == (8, 8, False)
    wrong = CliRunner().invoke(main, ["sweep", str(tmp_path / "none.yaml")])
    assert wrong.exit_code == 2
    assert "no such file" in wrong.stderr


@pytest.mark.slow
def test_command_says_how_to_go_on(
    write: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sweep_module, "simulate_point", Stopped(2))
    before = signal.getsignal(signal.SIGINT)  # ignored where a shell runs the tests with `&`
    out = tmp_path / "out"
    done = CliRunner().invoke(main, ["sweep", str(write(GOOD)), "--out", str(out), "--jobs", "1"])
    assert done.exit_code == 130
    assert "2 of 8 points, interrupted; run the same command to resume" in done.stdout
    assert len(cells(out / "points.csv")) == 2
    assert signal.getsignal(signal.SIGINT) is before


def test_shipped_sweep_loads() -> None:
    plan = load_sweep(ROOT / "configs/sweeps/delay-stability.yaml")
    assert {point.case for point in plan.points} == {"wave", "following", "kept"}
    for point in plan.points:
        keys = point.rig.coupling.pairs["cart"]
        if point.case == "following":
            assert keys.stiffness == pytest.approx(5 * 10 / point.rig.coupling.delay_s, rel=1e-5)
            assert keys.damping == 10
