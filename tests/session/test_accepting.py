"""The first day with real drives: each stage measures what it says, and the end is signed."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.session.acceptance.document import FILE, verify
from tests.rigs.running import Tree
from tests.runtime.test_device_faults import STAND, servo_tree
from tests.session.test_calibrating import BENCH

WAY = "[[0, 0], [1, 0], [2, 0.2], [3, 0.2], [4, -0.49], [5, 0.49], [6, 0], [99, 0]]"


def bench(folder: Path, environment: Tree | None = None) -> Path:
    """Write the bench without walls, its hand on a way of its own, and nothing else to touch."""
    data: Tree = yaml.safe_load(BENCH.read_text())
    for key in ("wall_master", "wall_slave"):
        del data["coupling"]["pairs"]["lever"][key]
    data["simulation"]["hand"]["lever"]["reference"]["waypoints"] = json.loads(WAY)
    data["simulation"]["environment"] = {"lever": environment or {"type": "free"}}
    for side in ("master", "slave"):
        data[side]["axes"]["lever"]["position_range"] = [-0.5, 0.5]
    return written(folder, data)


def written(folder: Path, data: Tree) -> Path:
    path = folder / "rig.yaml"
    text = json.dumps(data)  # YAML, too
    path.write_text(text)
    return path


def accept(rig: Path, stages: str, answers: str, *options: str) -> Any:
    (rig.parent / "answers.txt").write_text(answers)
    words = ["accept", str(rig), "--by", "a person", "--stages", stages, "--clock", "fake"]
    words += ["--script", str(rig.parent / "answers.txt"), "--out", str(rig.parent / "out")]
    return CliRunner().invoke(main, [*words, *options])


def checks(rig: Path) -> dict[tuple[str, str], dict[str, Any]]:
    content = json.loads((rig.parent / "out" / FILE).read_text())
    return {(one["stage"], one["what"]): one for one in content["checks"]}


@pytest.mark.slow
def test_by_hand_sign_scale_and_limits_are_measured(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    answers = f"0.1\n2\n{math.degrees(0.2):.3f}\n".replace("2\n", "2 ", 1) + "5.5\n"
    done = accept(rig, "identity,hand,limits", answers, "--axis", "master.lever")
    assert done.exit_code == 0, done.output
    found = checks(rig)
    assert found["scale", "master.lever"]["measured"]["ratio"] == pytest.approx(1.0, abs=0.03)
    assert found["limits", "master.lever"]["measured"]["highest"] > 0.45
    content = json.loads((tmp_path / "out" / FILE).read_text())
    assert content["accepted"]
    assert content["signature"]["by"] == "a person"
    assert "hand/recording.mcap" in content["files"]


def test_a_wrong_scale_ends_the_day_before_anything_gets_torque(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    done = accept(rig, "hand,noise", "2 30 degrees\n", "--axis", "master.lever")
    assert done.exit_code == 6
    assert "scale master.lever" in done.output
    assert "NOT GOOD, expected 1 within 0.05" in done.output
    assert not (tmp_path / "out" / "noise").exists()
    assert json.loads((tmp_path / "out" / FILE).read_text())["ended_at"] == "hand"


def test_noise_delay_and_effort_are_measured_under_torque(tmp_path: Path) -> None:
    scale = {"type": "spring", "stiffness": 8.0, "position": 0.0}
    rig = bench(tmp_path, environment=scale)
    answers = "0.1\n0.1\n0.1\n0.1 0.11\n0.1\n0.1 0.3\n"
    done = accept(rig, "noise,delay,effort", answers, "--axis", "slave.lever")
    assert done.exit_code == 6  # the scale read 0.3 of 0.22 N m
    found = checks(rig)
    assert found["noise", "slave.lever"]["good"]
    delay = found["delay", "slave.lever"]["measured"]
    assert 0.0 < delay["answered_after_s"] < 0.02
    assert delay["moved"] > 0.0
    assert found["effort", "slave.lever"]["measured"]["ratio"] == pytest.approx(0.3 / 0.22)


@pytest.mark.slow
def test_a_pulled_cable_is_noticed_and_the_devices_come_back(tmp_path: Path) -> None:
    data = servo_tree({"kind": "unplug", "at_s": 2.0})
    data["simulation"]["hand"]["a"]["reference"] = STAND
    data["simulation"]["environment"] = {}
    rig = written(tmp_path, data)
    done = accept(rig, "watchdog", "9\n0.1\n")
    assert done.exit_code == 0, done.output
    assert "unplugged" in checks(rig)["watchdog", "loss"]["measured"]["said"]
    assert (tmp_path / "out" / "watchdog" / "unplugged" / "recording.mcap").exists()


def test_a_cable_that_was_not_pulled_is_no_pass(tmp_path: Path) -> None:
    rig = written(tmp_path, servo_tree())
    done = accept(rig, "watchdog", "0.1\n")
    assert done.exit_code == 6
    assert checks(rig)["watchdog", "loss"]["measured"]["said"] == "nothing was lost"


@pytest.mark.slow
def test_the_coupled_rig_comes_last_gently_first(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    done = accept(rig, "gentle", "", "--run-s", "0.5")
    assert done.exit_code == 0, done.output
    ran = yaml.safe_load((tmp_path / "out" / "gentle" / "rig.yaml").read_text())
    assert ran["slave"]["axes"]["lever"]["effort_limit"] == pytest.approx(0.11)
    assert checks(rig)["gentle", "bench-1dof"]["measured"]["exit_code"] == 0.0


def test_what_was_signed_is_verified_to_the_byte(tmp_path: Path) -> None:
    rig = bench(tmp_path)
    assert accept(rig, "identity", "0.1\n").exit_code == 0
    path = tmp_path / "out" / FILE
    assert verify(path) == []
    assert CliRunner().invoke(main, ["accept", str(path), "--verify"]).exit_code == 0
    text = path.read_text()
    path.write_text(text.replace('"accepted": true', '"accepted": false'))
    assert verify(path) == [f"{path}: was changed after it was signed"]
    path.write_text(text)
    recording = tmp_path / "out" / "identity" / "recording.mcap"
    recording.write_bytes(recording.read_bytes() + b"x")
    done = CliRunner().invoke(main, ["accept", str(path), "--verify"])
    assert done.exit_code == 2
    assert "is not the file that was signed" in done.output
    recording.unlink()
    assert verify(path) == [f"{recording}: is gone"]
