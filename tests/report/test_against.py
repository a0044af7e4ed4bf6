"""`report RUN --against FILE`: what a run and a recording have in common."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.errors import ConfigError
from tautwave.report.against import compare_recording
from tautwave.report.run.rundir import Run
from tautwave.summary import Summary

T = 1e-3 * np.arange(1500)
X, Y = np.sin(7.0 * T), 0.9 * np.sin(7.0 * T - 0.1)
TAU = 0.2 * np.cos(3.0 * T)


class Columns(dict):  # type: ignore[type-arg]
    """The one thing of a recording that a run reads."""


@pytest.fixture
def run() -> Run:
    columns = {
        "time_s": T,
        "master.lever.position": X,
        "slave.lever.position": Y,
        "slave.lever.commanded": TAU,
    }
    rig = {"coupling": {"pairs": {"lever": {"sign": -1, "position_scale": 0.5}}}}
    rig |= {side: {"axes": {"lever": {"kind": "rotary"}}} for side in ("master", "slave")}
    whole = Columns(columns)
    return Run(Path("out"), rig, "", Summary(), tuple(columns), len(T), whole=whole, time=T)  # type: ignore[arg-type]


def csv(path: Path, **columns: np.ndarray) -> Path:
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, "%.17g", ",", header=",".join(columns), comments="")
    return path


def test_names_signs_and_factors_are_taken(run: Run, tmp_path: Path) -> None:
    file = csv(tmp_path / "a.csv", t=T + 5.0, x_master_angle=X, x_slave_angle=Y, f=-2.0 * TAU)
    found = {one.name: one for one in compare_recording(run, file)}
    assert list(found) == ["master.lever.position", "slave.lever.position", "lever.position_error"]
    assert found["lever.position_error"].rms == pytest.approx(
        (*2 * [np.sqrt(np.mean((X + 2.0 * Y) ** 2))], 0.0), rel=1e-6, abs=1e-9
    )
    [one] = compare_recording(run, file, ["slave.lever.commanded=-0.5*f"])
    assert one.unit == "N m"
    assert one.rms[2] == pytest.approx(0.0, abs=1e-9)
    assert one.explained == pytest.approx(1.0)
    [half] = compare_recording(run, file, ["slave.lever.commanded=-f"], begin_s=0.5, end_s=1.0)
    assert half.time_s[[0, -1]] == pytest.approx([0.5, 1.0])
    assert half.rms[1] == pytest.approx(0.5 * half.rms[0])
    assert half.explained == pytest.approx(0.75)


def test_what_does_not_vary_has_nothing_to_explain(run: Run, tmp_path: Path) -> None:
    [still] = compare_recording(run, csv(tmp_path / "a.csv", t=T, slave_position=0.0 * Y))
    assert still.explained is None
    json.dumps(still.as_dict(), allow_nan=False)


def test_what_is_missing_in_the_recording_is_not_compared(run: Run, tmp_path: Path) -> None:
    """A gap of 0.2 s, and as long without numbers: neither is made up."""
    shown = np.where((T >= 0.2) & (T < 0.4), np.nan, Y)
    kept = (T < 0.8) | (T >= 1.0)
    file = csv(tmp_path / "a.csv", t=T[kept], slave_position=shown[kept])
    [found] = compare_recording(run, file)
    left = found.time_s
    assert not np.any(((left > 0.2) & (left < 0.398)) | ((left > 0.8) & (left < 0.998)))
    assert len(left) == pytest.approx(1100, abs=5)
    assert found.explained is not None
    assert found.explained > 0.999
    none = csv(tmp_path / "b.csv", t=T, slave_position=np.nan * Y)
    with pytest.raises(ConfigError, match="fewer than two rows"):
        compare_recording(run, none)


@pytest.mark.parametrize(
    ("mapped", "said"),
    [
        ((), "no column is named as a position or command of master or slave"),
        (("slave.lever.commanded",), "write OURS=THEIRS"),
        (("slave.lever.commanded=g",), "has no column 'g'; it has t, f"),
        (("slave.lever.command=f",), "has no column 'slave.lever.command'"),
    ],
)
def test_what_cannot_be_compared_is_said(
    run: Run, tmp_path: Path, mapped: tuple[str, ...], said: str
) -> None:
    file = csv(tmp_path / "a.csv", t=T, f=TAU)
    with pytest.raises(ConfigError) as found:
        compare_recording(run, file, mapped)
    assert said in str(found.value)


def test_a_run_that_is_over_before_is_refused(run: Run, tmp_path: Path) -> None:
    file = csv(tmp_path / "a.csv", t=T[:50], slave_position=Y[:50])
    with pytest.raises(ConfigError, match="fewer than 100 cycles"):
        compare_recording(run, file)


@pytest.mark.slow
@pytest.mark.nightly
def test_a_replayed_run_is_its_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    quick = ("--clock", "fake", "--duration", "0.6")
    rig = str(Path(__file__).parents[2] / "configs/bench-1dof-2khz.yaml")
    played = "{id: 1, file: a, position: true.master.lever.position, repeat: false}"
    change = (
        f"buses.played={{driver: replay, options: {{devices: [{played}]}}}}",
        "master.axes.lever.bus=played",
        "simulation.hand={}",
    )
    sets = [word for each in change for word in ("--set", each)]
    for words in (
        ("run", rig, *quick, "--out", "a"),
        ("run", rig, *quick, "--out", "b", *sets),
        ("report", "b", "--against", "a", "--from", "0.25"),
    ):
        done = CliRunner().invoke(main, list(words))
        assert done.exit_code == 0, done.output
    found = json.loads((tmp_path / "b/against-a/against.json").read_text())["columns"]
    assert found["slave.lever.position"]["ratio"] == pytest.approx(1.0, abs=0.02)
    assert found["slave.lever.position"]["explained"] > 0.999
    assert (tmp_path / "b/against-a/against.png").stat().st_size > 10_000
