"""The device under a scene is identified as any other: the scene is off."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.config import load_rig, simulation_of
from tautwave.recordings.recording import read_recording
from tautwave.session.identification.identifying import identify_device

CONFIGS = Path(__file__).parents[2] / "configs"
SLOW = ["rate_hz=1000"]  # as fast as a device moves; audio rates take minutes here


@pytest.mark.slow
def test_the_truth_of_a_device_under_a_scene_is_found(tmp_path: Path) -> None:
    rig = load_rig(CONFIGS / "scene-drum.yaml", SLOW)
    result = identify_device(rig, out=tmp_path, clock="fake", duration_s=6.0)
    truth = simulation_of(rig, "master.stick")
    assert result.axis == "master.stick"
    assert result.fit.inertia.value == pytest.approx(truth.inertia, rel=0.01)
    assert result.fit.damping.value == pytest.approx(truth.damping, rel=0.1)
    assert any("The scene was off" in note for note in result.notes)
    recording = read_recording(tmp_path / "recording.mcap")
    axis = rig.axes["master.stick"]
    assert axis.position_range is not None
    assert abs(recording["master.stick.position"]).max() < axis.position_range[1]
    assert not any(name.startswith(("scene.", "slave.")) for name in recording.columns)


@pytest.mark.slow
def test_the_command_takes_a_scene(tmp_path: Path) -> None:
    words = ["identify", str(CONFIGS / "scene-resonator.yaml"), "--clock", "fake"]
    words += ["--duration", "3", "--set", SLOW[0], "--out", str(tmp_path / "out")]
    done = CliRunner().invoke(main, words)
    assert done.exit_code == 0, done.output
    assert "master.stylus" in done.output
    assert (tmp_path / "out" / "identification.json").is_file()
