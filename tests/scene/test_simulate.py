"""`simulate` of a rig with a scene gives the rows of a run on the fake clock, to the bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave import simulate
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError, SafetyStop
from tautwave.recordings.recording import read_recording
from tautwave.session import running
from tautwave.session.running import run

CONFIGS = Path(__file__).parents[2] / "configs"


def load(name: str, *given: str) -> Rig:
    return load_rig(CONFIGS / f"scene-{name}.yaml", given)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seconds"), [("resonator", 0.3), ("string", 0.1)])
def test_the_rows_are_those_of_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, seconds: float
) -> None:
    monkeypatch.setattr(running, "report_run", lambda _, summary, code, later: (summary, code))
    rig = load(name, f"duration_s={seconds}")
    run(rig, out=tmp_path, clock="fake")
    recorded = read_recording(tmp_path / "recording.mcap")
    rows = simulate(rig, engine="python")
    assert rows.error is None
    assert set(recorded.columns) == set(rows.columns)
    assert len(rows) == len(recorded.time_s)
    for column in rows.columns:
        assert np.array_equal(rows[column], recorded[column], equal_nan=True), column
    assert rig.scene is not None
    (port,) = rig.scene.ports
    assert np.abs(rows[f"scene.asked.{port}"]).max() > 0.0


def test_a_duration_of_ones_own_is_taken() -> None:
    assert len(simulate(load("resonator"), duration_s=0.01, engine="python")) == 100


def test_a_stop_ends_the_rows_and_is_reported() -> None:
    moved = "simulation.hand.stylus.reference.waypoints=[[0.0, 0.0], [0.02, 0.1]]"
    limit = "master.axes.stylus.position_range=[-0.01, 0.01]"
    rows = simulate(load("resonator", moved, limit), duration_s=0.2, engine="python")
    assert isinstance(rows.error, SafetyStop)
    assert "left its position range" in str(rows.error)
    assert 10 < len(rows) < 2000


@pytest.mark.slow
def test_a_scene_that_never_begins_is_an_error() -> None:
    leaning = ("simulation.axes.master.stylus.start_position=0.05", "simulation.hand={}")
    with pytest.raises(SafetyStop, match="not engaged"):
        simulate(load("resonator", *leaning, "rate_hz=1000", "duration_s=6"), engine="python")


def test_no_other_engine_does_scenes() -> None:
    with pytest.raises(ConfigError, match="engines: compiled, python"):
        simulate(load("resonator"), engine="fortran")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["resonator", "granular", "string", "drum"])
def test_compiled_rows_are_the_same(name: str) -> None:
    pytest.importorskip("numba")
    rig = load(name, "duration_s=0.2")
    fast, slow = simulate(rig), simulate(rig, engine="python")
    assert fast.columns == slow.columns
    assert np.array_equal(fast.data, slow.data, equal_nan=True)
