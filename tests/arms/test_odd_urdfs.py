"""URDF files that could be read wrongly without a word: locked joints, degrees, grams."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from tautwave.cli import main
from tautwave.config.inputs.urdf import read_urdf
from tautwave.errors import ConfigError
from tautwave.models.chain.build import build_chain
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames, tip_pose

DOWN = (0.0, 0.0, -9.81)
LIMIT = '<limit lower="-2" upper="2" effort="40" velocity="2"/>'
KINDS = ("revolute", "revolute", "revolute", "prismatic")


def urdf(folder: Path, limits: dict[int, str] | None = None, joint: str = "") -> Path:
    """Write four joints, names with slashes as a namespace makes them, one after the other."""
    parts = ['<robot name="odd"><link name="base"/>', joint]
    parent = "base"
    for number, kind in enumerate(KINDS):
        name = f"arm/link.{number}"
        parts.append(
            f'<link name="{name}"><inertial><origin xyz="0.05 0.02 0.1"/><mass value="1"/><inertia '
            'ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
            f'<joint name="arm/j.{number}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{name}"/><origin xyz="0 0.02 0.2" rpy="0.3 0.1 0.2"/>'
            f'<axis xyz="0 1 0.3"/>{(limits or {}).get(number, LIMIT)}</joint>'
        )
        parent = name
    path = folder / "odd.urdf"
    path.write_text("".join(parts) + "</robot>")
    return path


@pytest.mark.parametrize(("locked", "value"), [(1, 0.0), (1, 0.7), (2, -0.4), (3, 0.15)])
def test_a_joint_with_nowhere_to_go_is_fixed_where_it_is(
    tmp_path: Path, locked: int, value: float
) -> None:
    """It got a range of half a turn each way, and a motor that drove it."""
    end = f'<limit lower="{value}" upper="{value}" effort="40" velocity="2"/>'
    whole = read_urdf(urdf(tmp_path), "arm/link.3")
    found = read_urdf(urdf(tmp_path, {locked: end}), "arm/link.3")
    assert [one.name for one in found.limits] == [
        f"arm/j.{number}" for number in range(4) if number != locked
    ]
    assert any(f"'arm/j.{locked}' is locked at {value:g}" in note for note in found.notes)
    q = [0.3, -0.5, 0.4, 0.1]
    q[locked] = value
    left = [one for number, one in enumerate(q) if number != locked]
    places, weights = [], []
    for links, at in ((whole.links, q), (found.links, left)):
        chain = build_chain(links, DOWN)
        frames = chain_frames(chain, at)
        out = [0.0] * len(at)
        chain_gravity(chain, frames, out)
        places.append(tip_pose(chain, frames))
        weights.append(out)
    del weights[0][locked]
    assert places[1] == pytest.approx(places[0], abs=1e-12)
    assert weights[1] == pytest.approx(weights[0], abs=1e-12)


ZEROS = '<limit lower="0" upper="0" effort="0" velocity="0"/>'


@pytest.mark.parametrize("limit", [ZEROS, '<limit effort="4" velocity="2"/>', ""])
def test_limits_that_nobody_set_lock_nothing(tmp_path: Path, limit: str) -> None:
    """As exporters write them, and as the format's own defaults are."""
    found = read_urdf(urdf(tmp_path, {1: limit}))
    assert len(found.limits) == 4
    assert not found.notes


@pytest.mark.parametrize(
    ("lower", "upper", "refused"),
    [(-150, 150, True), (0, 360, True), (-27.7, 27.7, False), (-6.3, 6.3, False)],
)
def test_limits_in_degrees_are_refused(
    tmp_path: Path, lower: float, upper: float, refused: bool
) -> None:
    """They made a rig whose joints may turn 24 times each way, which was certified."""
    limit = f'<limit lower="{lower}" upper="{upper}" effort="40" velocity="2"/>'
    path = urdf(tmp_path, {2: limit})
    if not refused:
        assert read_urdf(path).limits[2].upper == upper
        return
    with pytest.raises(ConfigError, match="a URDF has radians") as error:
        read_urdf(path)
    assert "joint 'arm/j.2': its limits are" in str(error.value)
    slides = urdf(tmp_path, {3: '<limit lower="0" upper="60" effort="40" velocity="2"/>'})
    assert read_urdf(slides).limits[3].upper == 60.0  # a long rail


def new(folder: Path, path: Path, *words: str) -> str:
    rig = str(folder / "rig.yaml")
    done = CliRunner().invoke(main, ["new", rig, "--urdf", str(path), *words])
    assert done.exit_code in (0, 2), done.output
    return done.output if done.exit_code else ""


def test_an_arm_on_a_floating_base_is_told_what_it_stands_on(tmp_path: Path) -> None:
    floating = (
        '<link name="map"/><joint name="virtual" type="floating"><parent link="map"/>'
        '<child link="base"/></joint>'
    )
    path = urdf(tmp_path, joint=floating)
    said = new(tmp_path, path)
    assert "state `--base base`" in said
    assert new(tmp_path, path, "--base", "base") == ""  # what it says helps


@pytest.mark.parametrize("kind", ["grams", "millimetres"])
def test_masses_and_lengths_in_another_unit_are_asked_for(tmp_path: Path, kind: str) -> None:
    path = urdf(tmp_path)
    text = path.read_text()
    if kind == "grams":
        text = text.replace('mass value="1"', 'mass value="1000"')
    else:
        text = re.sub(r'xyz="0 0.02 0.2"', 'xyz="0 20 200"', text)
    path.write_text(text)
    said = new(tmp_path, path)
    assert said.count("\n") == 1
    assert "are the masses of its arm in kg, its lengths and origins in m?" in said
