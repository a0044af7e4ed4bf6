"""`tautwave new --urdf`: from an arm's file to two arms that are certified and track."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result

from tautwave.certificate import certify
from tautwave.cli import main
from tautwave.config import Rig, load_rig
from tautwave.recordings.recording import read_recording
from tautwave.session.new.arms import read_arm

Cli = Callable[..., Result]

BODY = (
    '<inertial><origin xyz="0 0 0.06"/><mass value="{}"/><inertia ixx="2e-3" iyy="2e-3" '
    'izz="1e-3" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def joint(name: str, kind: str, parent: str, child: str, axis: str, more: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0 0 0.12"/><axis xyz="{axis}"/>{more}</joint>'
    )


LIMIT = '<limit lower="{}" upper="{}" effort="{}" velocity="{}"/>'
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1", "0 1 0")


def arm_file(path: Path, kind: str, count: int = 3) -> Path:
    """Write an arm of so many joints with a gripper; `kind` is what its file lacks or has odd."""
    mass = 0.0 if kind == "massless" else 0.4
    links = ["base", *(f"l{k}" for k in range(1, count + 1)), "hand", "left", "right"]
    parts = [f'<link name="{name}">{BODY.format(mass)}</link>' for name in links]
    joints = []
    for k in range(count):
        effort, speed = (0, 0) if kind == "no limits" else (40.0, 3.0)
        low, high = (0, 0) if kind == "no limits" else (-2.0, 2.0)
        if kind == "one-sided" and k == 1:
            low, high = -3.0, -0.1
        more = LIMIT.format(low, high, effort, speed)
        if kind == "friction":
            more += '<dynamics damping="0.8" friction="0.3"/>'
        if kind == "simulator's":
            more += '<dynamics damping="1e-3"/>'
        turn = "prismatic" if kind == "slide" and k == 0 else "revolute"
        if turn == "prismatic":
            more = LIMIT.format(-0.2, 0.2, 200.0, 0.5)
        turn = "continuous" if kind == "continuous" else turn
        name = f"arm/joint.{k + 1}" if kind == "names" else f"joint{k + 1}"
        joints.append(joint(name, turn, links[k], links[k + 1], AXES[k], more))
    joints.append(joint("flange", "fixed", links[count], "hand", "0 0 1"))
    finger = LIMIT.format(0.0, 0.04, 20.0, 0.2)
    joints.append(joint("finger1", "prismatic", "hand", "left", "0 1 0", finger))
    mimic = "" if kind == "branch" else '<mimic joint="finger1"/>'
    joints.append(joint("finger2", "prismatic", "hand", "right", "0 1 0", finger + mimic))
    if kind == "tip first":
        joints.reverse()
    path.write_text(f'<robot name="arm">{"".join(parts)}{"".join(joints)}</robot>')
    return path


def new(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["new", *map(str, arguments)])


def written(folder: Path, *arguments: object) -> Rig:
    path = folder / "pair.yaml"
    done = new(path, *arguments)
    assert done.exit_code == 0, done.output
    assert f"next: tautwave check {path}" in done.output
    return load_rig(path, choose=False)


KINDS = (
    "mimic", "branch", "tip first", "massless", "no limits", "continuous", "slide", "friction",
    "simulator's", "one-sided", "names",
)  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_what_the_file_says_is_in_the_rig_and_what_it_does_not_is_marked(
    tmp_path: Path, kind: str
) -> None:
    file = arm_file(tmp_path / "arm.urdf", kind)
    rig = written(tmp_path, "--urdf", file, "--tip", "hand")
    arm = read_arm(file, "hand", None)
    text = (tmp_path / "pair.yaml").read_text()
    marked = [line for line in text.splitlines() if "TODO" in line]
    assert len(rig.coupling.pairs) == 3
    for side in (rig.master, rig.slave):
        assert side.arm is not None
        for axis, one in zip(side.axes.values(), arm.joints, strict=True):
            limits = one.limits
            if math.isfinite(limits.upper - limits.lower):
                assert axis.position_range == (limits.lower, limits.upper)
            if math.isfinite(limits.effort):
                assert axis.effort_limit == limits.effort
                assert axis.velocity_limit == limits.velocity
            else:
                assert any("effort_limit" in line for line in marked)
                assert any("velocity_limit" in line for line in marked)
    for key in ("encoder_quantum", "effort_rate_limit", "inertia"):  # no URDF has these
        assert any(key in line for line in marked)
    assert any("damping" in line for line in marked) == (kind != "friction")
    assert any("position_range" in line for line in marked) == (kind in ("no limits", "continuous"))


@pytest.mark.sparse(11)
@pytest.mark.parametrize("kind", [k for k in KINDS if k != "massless"])
def test_each_kind_is_certified_as_it_comes(tmp_path: Path, kind: str) -> None:
    written(tmp_path, "--urdf", arm_file(tmp_path / "arm.urdf", kind), "--tip", "hand")
    verdict = certify(load_rig(tmp_path / "pair.yaml")).verdicts["passive"]
    assert verdict.passed, verdict.reason


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize(("kind", "count"), [("one-sided", 3), ("friction", 2)])
def test_three_commands_lead_to_arms_that_track(
    tmp_path: Path, tautwave_cli: Cli, kind: str, count: int
) -> None:
    """Within 10 mrad rms, with a hand that moves every joint by a tenth of a radian or more."""
    file, rig = arm_file(tmp_path / "arm.urdf", kind, count), tmp_path / "pair.yaml"
    assert tautwave_cli("new", rig, "--urdf", file, "--tip", "hand").exit_code == 0
    checked = tautwave_cli("check", rig)
    assert checked.exit_code == 0, checked.output
    assert len(checked.stdout.splitlines()) <= 95  # a screen, as of six pairs
    out = tmp_path / "run"
    cut = ("--set", "duration_s=2")
    done = tautwave_cli("run", rig, "--clock", "fake", "--out", out, *cut)
    assert done.exit_code == 0, done.output
    recording = read_recording(out / "recording.mcap")
    for name in load_rig(rig, choose=False).coupling.pairs:
        led, follows = (recording[f"{side}.{name}.position"] for side in ("master", "slave"))
        assert np.sqrt(np.mean((follows - led) ** 2)) < 0.010
        assert np.ptp(follows) > 0.1


def test_two_files_make_a_leader_and_a_follower(tmp_path: Path) -> None:
    """Pairs have the follower's names; the leader's axes say which joint they are."""
    leader = arm_file(tmp_path / "a.urdf", "names")
    follower = arm_file(tmp_path / "b.urdf", "mimic")
    rig = written(tmp_path, "--urdf", leader, "--urdf", follower, "--tip", "hand")
    assert list(rig.coupling.pairs) == ["joint1", "joint2", "joint3"]
    assert [axis.joint for axis in rig.master.axes.values()] == [
        "arm/joint.1", "arm/joint.2", "arm/joint.3",
    ]  # fmt: skip
    keys: Any = yaml.safe_load((tmp_path / "pair.yaml").read_text())
    assert [keys[side]["arm"]["urdf"] for side in ("master", "slave")] == ["a.urdf", "b.urdf"]


@pytest.mark.parametrize(
    ("arguments", "code", "said"),
    [
        (("--urdf", "arm.urdf"), 2, "`--tip hand`"),
        (("--urdf", "arm.urdf", "--tip", "fist"), 2, "there is no link 'fist'"),
        (("--urdf", "none.urdf", "--tip", "hand"), 2, "none.urdf"),
        (("--urdf", "arm.urdf", "--tip", "hand", "--tip", "l2"), 2, "has 3 joints and the follow"),
        (("--tip", "hand"), 2, "--tip requires --urdf"),
        (("--urdf", "arm.urdf", "--from", "arms-loopback"), 2, "mutually exclusive"),
    ],
)
def test_what_makes_no_pair_is_said_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], code: int,
    said: str,
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    arm_file(tmp_path / "arm.urdf", "branch")
    done = new("pair.yaml", *arguments)
    assert done.exit_code == code, done.output
    assert said in done.output
    assert not Path("pair.yaml").exists()
    remedy = re.search(r"`--tip (\w+)`", done.output)
    if remedy is not None:  # what it names works
        assert new("pair.yaml", "--urdf", "arm.urdf", "--tip", remedy[1]).exit_code == 0
