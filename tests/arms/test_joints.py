"""Which axis is which joint: names decide, whatever the order of rig or URDF."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from tautwave.config import Rig, load_rig, parse_rig, resolved_yaml
from tautwave.config.inputs.urdf import read_urdf
from tautwave.errors import ConfigError
from tautwave.rig import command_delays
from tautwave.rig.arms import beyond_file, greatest_loads, joint_names
from tautwave.session.facts import load_facts

SHIPPED = Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml"
JOINTS = ("pan", "lift", "bend")
RANGE = (-1.0, 1.0)


def link(name: str, mass: float) -> str:
    body = f'<mass value="{mass}"/><origin xyz="0.1 0 0"/>'
    return f'<link name="{name}"><inertial>{body}</inertial></link>'


def urdf(folder: Path, order: tuple[str, ...] = JOINTS, mass: float = 0.5, end: str = "") -> Path:
    """Write an arm that pans, lifts and bends, its joints listed in any order."""
    ends = {"pan": ("base", "turn"), "lift": ("turn", "upper"), "bend": ("upper", "fore")}
    axis = {"pan": "0 0 1", "lift": "0 1 0", "bend": "0 1 0"}
    joints = "".join(
        f'<joint name="{name}{end}" type="revolute"><parent link="{ends[name][0]}"/>'
        f'<child link="{ends[name][1]}"/><origin xyz="0.2 0 0"/><axis xyz="{axis[name]}"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="3"/></joint>'
        for name in order
    )
    links = "".join(link(name, mass) for name in ("base", "turn", "upper", "fore"))
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="a">{links}{joints}</robot>')
    return path


def rig_of(folder: Path, names: tuple[str, ...], arm: dict[str, Any], **joints: str) -> Rig:
    """Return a rig whose axes have these names, in this order; `joints` states some."""
    values = yaml.safe_load(SHIPPED.read_text())
    axes = {}
    for number, name in enumerate(names):
        axis = dict(values["slave"]["axes"]["lever"], id=number + 1, position_range=list(RANGE))
        axes[name] = axis | {"effort_limit": 40.0}
    values["master"]["axes"] = {name: axis | {"bus": "hand"} for name, axis in axes.items()}
    for name, joint in joints.items():
        axes[name]["joint"] = joint
    values["slave"] |= {"axes": axes, "arm": arm}
    pair = dict(values["coupling"]["pairs"]["lever"])
    del pair["wall_master"], pair["wall_slave"]
    values["coupling"]["pairs"] = dict.fromkeys(names, pair)
    values["simulation"] = {}
    path = folder / "rig.yaml"
    path.write_text(json.dumps(values, indent=1))
    return load_rig(path, choose=False)


def loads(rig: Rig) -> dict[str, float]:
    return {name.partition(".")[2]: load for name, load in greatest_loads(rig, "slave").items()}


@pytest.mark.parametrize("step", [7, pytest.param(1, marks=pytest.mark.slow)])
def test_names_decide_in_every_order_of_axes_and_of_the_file(tmp_path: Path, step: int) -> None:
    """A base that turns about gravity has no load, a shoulder the most."""
    urdf(tmp_path)
    expected = loads(rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf"}))
    assert expected["pan"] == 0.0
    assert expected["lift"] > expected["bend"] > 0.1
    orders = itertools.product(itertools.permutations(JOINTS), repeat=2)
    for names, order in itertools.islice(orders, 0, None, step):
        urdf(tmp_path, order)
        rig = rig_of(tmp_path, names, {"urdf": "arm.urdf"})
        assert loads(rig) == expected
        assert list(rig.slave.axes) == list(JOINTS)  # and stays so, as it is recorded
        again = parse_rig(resolved_yaml(rig), tmp_path / "again.yaml", choose=False)
        assert again == rig


def test_a_stated_joint_decides_over_a_name(tmp_path: Path) -> None:
    urdf(tmp_path, end="_joint")
    names = ("a", "b", "c")
    stated = {"a": "bend_joint", "b": "pan_joint", "c": "lift_joint"}
    rig = rig_of(tmp_path, names, {"urdf": "arm.urdf"}, **stated)
    assert joint_names(rig, "slave") == {f"slave.{name}": stated[name] for name in "bca"}
    assert loads(rig)["b"] == 0.0
    # One that is stated, two by their own names: the two swap nothing.
    urdf(tmp_path)
    rig = rig_of(tmp_path, ("x", "lift", "pan"), {"urdf": "arm.urdf"}, x="bend")
    assert list(rig.slave.axes) == ["pan", "lift", "x"]


def test_an_order_counts_only_where_it_is_stated(tmp_path: Path) -> None:
    urdf(tmp_path)
    names = ("one", "two", "three")
    with pytest.raises(ConfigError, match="no axis has the name of a joint; give each its `joint`"):
        rig_of(tmp_path, names, {"urdf": "arm.urdf"})
    rig = rig_of(tmp_path, names, {"urdf": "arm.urdf", "order": "base_to_tip"})
    assert loads(rig)["one"] == 0.0
    assert list(rig.slave.axes) == list(names)
    # Names that say otherwise are believed: the order was of strange names.
    rig = rig_of(tmp_path, JOINTS[::-1], {"urdf": "arm.urdf", "order": "base_to_tip"})
    assert loads(rig)["pan"] == 0.0


@pytest.mark.parametrize(
    ("names", "stated", "said"),
    [
        (("pan", "lift", "wrist"), {}, "slave.axes.wrist: the arm has no joint of this name"),
        (("pan", "lift", "w"), {"w": "tilt"}, "there is no joint 'tilt' in the arm; its joints"),
        (("pan", "lift", "w"), {"w": "lift"}, "axis 'lift' is joint 'lift' too"),
        (("pan", "lift", "bend"), {"pan": "lift"}, "axis 'pan' is joint 'lift' too"),
    ],
)
def test_names_that_do_not_fit_are_refused(
    tmp_path: Path, names: tuple[str, ...], stated: dict[str, str], said: str
) -> None:
    urdf(tmp_path)
    with pytest.raises(ConfigError) as caught:
        rig_of(tmp_path, names, {"urdf": "arm.urdf"}, **stated)
    (problem,) = caught.value.problems
    assert said in problem


def test_a_joint_without_an_arm_or_with_rows_is_refused() -> None:
    with pytest.raises(ConfigError, match="the slave has no arm; remove it"):
        load_rig(SHIPPED, ["slave.axes.lever.joint=elbow"])
    with pytest.raises(ConfigError, match="rows of dh are in the order of the axes; remove it"):
        load_rig(SHIPPED, ["slave.axes.lever.joint=elbow", "slave.arm={dh: [{mass: 0.1}]}"])
    with pytest.raises(ConfigError, match="rows of dh are in that order anyway"):
        load_rig(SHIPPED, ["slave.arm={dh: [{mass: 0.1}], order: base_to_tip}"])


def test_the_truth_of_an_arm_has_its_order(tmp_path: Path) -> None:
    urdf(tmp_path)
    other = tmp_path / "other"
    other.mkdir()
    text = urdf(other).read_text()
    for one, two in (("pan", "@"), ("bend", "pan"), ("@", "bend")):
        text = text.replace(f'joint name="{one}"', f'joint name="{two}"')
    (other / "arm.urdf").write_text(text)
    rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf"})
    path = tmp_path / "rig.yaml"
    truth = f"simulation.arms.slave={{urdf: {other}/arm.urdf}}"
    with pytest.raises(ConfigError, match=r"bend, lift, pan from base to tip, are not in the ord"):
        load_rig(path, [truth])
    load_rig(path, [truth.replace(str(other), str(tmp_path))], choose=False)


def test_check_names_the_joint_beside_the_axis_with_its_load(tmp_path: Path) -> None:
    urdf(tmp_path)
    rig = rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf"})
    said = dict(load_facts(rig, command_delays(rig)))
    assert said["load of slave.lift"].startswith("joint lift, up to ")


def test_a_chain_without_any_mass_has_nothing_to_carry(tmp_path: Path) -> None:
    urdf(tmp_path, mass=0.0)
    with pytest.raises(ConfigError, match="no weight to compensate for; give masses, or state"):
        rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf"})
    for arm in (
        {"compensate": False}, {"payload": {"mass": 0.1}}, {"gravity": [0.0, 0.0, 0.0]},
    ):  # fmt: skip
        rig = rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf", **arm})
    rig = rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf", "compensate": False})
    said = dict(load_facts(rig, command_delays(rig)))
    assert said["arm of the slave"] == "no link has a mass: a kinematic chain, without a load"


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("position_range", [-1.0, 1.2], "position_range [-1, 1.2], joint lift -1 to 1 rad"),
        ("position_range", [-1.3, 0.5], "position_range [-1.3, 0.5], joint lift -1 to 1 rad"),
        ("effort_limit", 9.5, "effort_limit 9.5, joint lift 9 N m"),
        ("velocity_limit", 3.5, "velocity_limit 3.5, joint lift 3 rad/s"),
        ("position_range", [-0.9, 1.0], None),
        ("effort_limit", 9.0, None),
    ],
)
def test_limits_wider_than_the_files_are_said_with_joint_and_number(
    tmp_path: Path, key: str, value: Any, said: str | None
) -> None:
    urdf(tmp_path)
    rig = rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf"})
    within = {"effort_limit": 9.0, "velocity_limit": 3.0, "position_range": (-1.0, 1.0)}
    axes = {name: axis.model_copy(update=within) for name, axis in rig.slave.axes.items()}
    given = tuple(value) if isinstance(value, list) else value
    axes["lift"] = axes["lift"].model_copy(update={key: given})
    rig = rig.model_copy(update={"slave": rig.slave.model_copy(update={"axes": axes})})
    wider = beyond_file(rig, rig.arms("slave")[0])
    assert wider == ([f"slave.lift has {said}"] if said else [])
    facts = dict(load_facts(rig, command_delays(rig)))
    assert ("limits of slave" in facts) == bool(said)


@pytest.mark.parametrize("limit", ['lower="0" upper="0" effort="0" velocity="0"', ""])
def test_a_placeholder_limits_nothing(tmp_path: Path, limit: str) -> None:
    path = urdf(tmp_path)
    path.write_text(path.read_text().replace('lower="-1" upper="1" effort="9" velocity="3"', limit))
    rig = rig_of(tmp_path, JOINTS, {"urdf": "arm.urdf"})
    assert beyond_file(rig, rig.arms("slave")[0]) == []
    assert all(math.isinf(one.upper - one.lower) for one in read_urdf(path).limits)
