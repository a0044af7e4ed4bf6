"""Several arms on a side: what one rig of two does is what two rigs of one do, to the bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.certificate.verdict import certify
from tautwave.config import Rig, load_rig, parse_rig, resolved_yaml
from tautwave.errors import ConfigError
from tautwave.report.arms.parts import arm_parts
from tautwave.rig import command_delays
from tautwave.rig.arms import (
    greatest_loads,
    joint_names,
    load_stiffnesses,
    own_carried,
    without_carrying,
)
from tautwave.rig.carrying import side_loads
from tautwave.rig.led import led_by_policy
from tautwave.runtime.carrying.side import take_payload
from tautwave.session.facts import load_facts
from tautwave.session.identification.weighing import arm_to_weigh
from tests.rigs.running import run_rig

Tree = dict[str, Any]

ARMS = ("left", "right")
JOINTS = ("turn", "bend")
UPPER = {"left": 0.3, "right": 0.2}
"""[m] Lengths of the upper links: the arms are different ones."""


def chain(arm: str, side: str) -> Tree:
    size = UPPER[arm] * (1.0 if side == "slave" else 0.5)
    return {
        "dh": [
            {"alpha": 1.5707963},
            {"a": size, "mass": 0.6 * size, "centre": [-0.5 * size, 0.0, 0.0]},
        ],
        "payload": {"mass": 0.1},
    }


def tree(arms: tuple[str, ...] = ARMS, *, single: bool = False, **keys: Tree) -> Tree:
    """Return a rig of some of both arms; `single` names one as the only one of its side.

    `keys` are added to the slave's arms, by name.
    """
    out: Tree = {"name": "two", "rate_hz": 1000, "duration_s": 0.03, "seed": 1, "buses": {}}
    out["coupling"] = {"engage_ramp_s": 0.01, "pairs": {}}
    out["simulation"] = {"hand": {}}
    for side in ("master", "slave"):
        out[side] = {"axes": {}}
        own = {
            arm: chain(arm, side) | (keys.get(arm, {}) if side == "slave" else {}) for arm in arms
        }
        out[side] |= {"arm": own[arms[0]]} if single else {"arms": own}
        for arm in arms:
            out["buses"][f"{side}_{arm}"] = {"driver": "loopback"}
            for number, joint in enumerate(JOINTS):
                out[side]["axes"][f"{arm}_{joint}"] = {
                    "bus": f"{side}_{arm}", "id": number, "kind": "rotary", "effort_limit": 8,
                    "effort_rate_limit": 4000, "velocity_limit": 12, "position_range": [-1.2, 1.2],
                    "inertia": {"value": 0.02, "lower": 0.012, "source": "test"},
                    "damping": {"value": 0.2, "lower": 0.15, "source": "test"},
                }  # fmt: skip
    for arm in arms:
        for joint in JOINTS:
            out["coupling"]["pairs"][f"{arm}_{joint}"] = {"offset": 0.0, "engage_tolerance": 0.1}
            out["simulation"]["hand"][f"{arm}_{joint}"] = {
                "lever_arm": 0.2,
                "reference": {
                    "type": "multisine",
                    "components": [[3.0, 3.0 * UPPER[arm], 0.0]],
                    "ramp_s": 0.01,
                },
            }
    return out


def rig_of(values: Tree, *overrides: str) -> Rig:
    return parse_rig(json.dumps(values), "two.yaml", overrides)


REFLECTED: dict[str, Tree] = {
    "carried": {},
    "one is felt": {"left": {"reflect_load": True}},
    "both are felt": {arm: {"reflect_load": True} for arm in ARMS},
    "one is carried by the coupling": {"right": {"compensate": False}},
}


@pytest.mark.sparse(2)
@pytest.mark.parametrize("keys", REFLECTED.values(), ids=REFLECTED)
def test_two_arms_in_one_rig_do_what_they_do_in_two(keys: dict[str, Tree]) -> None:
    both = rig_of(tree(**keys))
    rows = run_rig(both)
    verdicts = {one.name: one for one in certify(both, brief=True).elements if one.kind == "load"}
    for arm in ARMS:
        alone = rig_of(tree((arm,), single=True, **keys))
        apart = run_rig(alone)
        for name in apart.columns:
            column, values = name, apart[name]
            start, _, rest = column.partition(".")
            side = rest.partition(".")[0]
            if start in ("arm", "load") and f".{arm}_" not in column:
                column = column.replace(side, f"{side}.{arm}", 1)
            if start != "loop":
                assert np.array_equal(rows[column], values, equal_nan=True), column
        for one in certify(alone, brief=True).elements:
            if one.kind == "load":
                assert verdicts[one.name] == one
    assert np.ptp(rows["true.slave.left_bend.position"]) > 1e-5
    assert any(column.startswith("load.slave.left.") for column in rows.columns)


def test_what_is_asked_of_a_side_has_the_axes_of_all_its_arms() -> None:
    rig = rig_of(tree(right={"compensate": False}))
    axes = [f"slave.{arm}_{joint}" for arm in ARMS for joint in JOINTS]
    assert [arm.name for arm in rig.arms("slave")] == ["slave.left", "slave.right"]
    assert list(joint_names(rig, "slave")) == list(greatest_loads(rig, "slave")) == axes
    assert own_carried(rig, "slave") == list(load_stiffnesses(rig, "slave")) == axes[:2]
    assert own_carried(without_carrying(rig), "slave") == []
    assert [part.name for part in arm_parts(rig)] == [
        f"{side}.{arm}" for side in ("master", "slave") for arm in ARMS
    ]
    assert parse_rig(resolved_yaml(rig), "two.yaml") == rig
    assert rig.simulation is not None
    assert list(rig.simulation.arms) == [part.name for part in arm_parts(rig)]


def test_a_truth_of_one_arm_is_set_by_its_plain_name() -> None:
    rig = rig_of(tree(), "simulation.arms.slave.left.dh=[{}, {a: 0.3, mass: 0.2}]")
    assert rig.simulation is not None
    truth = rig.simulation.arms["slave.left"].dh
    assert truth is not None
    assert truth[1].mass == 0.2
    with pytest.raises(ConfigError, match=r"the rig has no such arm; use master\.left"):
        rig_of(tree(), "simulation.arms.slave.dh=[{}, {a: 0.3, mass: 0.2}]")


def test_identification_moves_the_joints_of_one_arm() -> None:
    rig = rig_of(tree())
    found = arm_to_weigh(rig, "slave.right_bend")
    assert found is not None
    assert found.axes == ("slave.right_turn", "slave.right_bend")
    with pytest.raises(ConfigError, match="choose an axis, or one of an arm's, with --axis"):
        arm_to_weigh(rig, None)


def test_a_policy_leads_the_followers_of_two_arms() -> None:
    rig = led_by_policy(rig_of(tree()), 30.0)
    assert rig.arms("master") == ()
    assert rig.simulation is not None
    assert list(rig.simulation.arms) == ["slave.left", "slave.right"]


def test_each_arm_takes_up_its_own_payload() -> None:
    payloads = {"payloads": {"box": {"mass": 0.3}}}
    values = tree(left=payloads, right=payloads) | {"operate": {"start": "engaged"}}
    rig = rig_of(values)
    loads, _ = side_loads(rig, command_delays(rig))
    said, refused = take_payload(loads, "box")
    assert refused
    assert said == "payload: state the arm, slave.left or slave.right (got 'box')"
    assert take_payload(loads, "slave.left box")[0].endswith(
        "the position of arm slave.left is not known yet"
    )
    for load in loads:
        for which in range(len(load.axes)):
            load.pass_slots(which, 1)
            load.take(which, 0.2)
            load.effort(which)
    assert take_payload(loads, "slave.left box") == ("slave.left box", False)
    said, refused = take_payload(loads, "slave.left box")
    assert refused
    assert said == "payload 'slave.left box': the previous payload is still being applied"
    by_name = {load.name: load for load in loads}
    held = {name: load.effort(1) for name, load in by_name.items()}
    for _ in range(600):
        for load in loads:
            load.pass_slots(0, 1)
            load.effort(1)
    assert by_name["slave.left"].effort(1) > 1.5 * held["slave.left"]
    assert by_name["slave.right"].effort(1) == held["slave.right"]
    # What a change may supply is stated for the arm that it is of.
    elements = certify(rig, brief=True).elements
    found = {one.axis: one.numbers for one in elements if one.kind == "load"}
    assert found["slave.left_turn"]["payload_j"] > found["slave.right_turn"]["payload_j"] > 0.0
    assert "payload_j" not in found["slave.left_bend"]


URDF = """<robot name="pair"><link name="body"/>{}</robot>"""
ARM = """
<link name="{0}upper"><inertial><origin xyz="0.1 0 0"/><mass value="0.2"/></inertial></link>
<link name="{0}lower"><inertial><origin xyz="0.1 0 0"/><mass value="0.1"/></inertial></link>
<joint name="{0}bend" type="revolute"><parent link="{0}upper"/><child link="{0}lower"/>
<origin xyz="0.2 0 0"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="9" velocity="20"/></joint>
<joint name="{0}turn" type="revolute"><parent link="body"/><child link="{0}upper"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="9" velocity="20"/></joint>
"""


@pytest.mark.parametrize("whole", [True, False], ids=["a body of two arms", "one arm twice"])
def test_an_axis_is_the_joint_of_its_name_with_or_without_its_arms(
    tmp_path: Path, whole: bool
) -> None:
    text = "".join(ARM.format(f"{arm}_") for arm in ARMS) if whole else ARM.format("")
    (tmp_path / "pair.urdf").write_text(URDF.format(text))
    values = tree()
    for side in ("master", "slave"):
        values[side]["arms"] = {
            arm: {"urdf": "pair.urdf", "tip": f"{arm}_lower" if whole else "lower"} for arm in ARMS
        }
        values[side]["axes"] = dict(reversed(values[side]["axes"].items()))
    path = tmp_path / "two.yaml"
    path.write_text(json.dumps(values))
    rig = load_rig(path)
    assert list(rig.slave.axes) == ["left_turn", "left_bend", "right_turn", "right_bend"]
    found = joint_names(rig, "slave")
    assert found["slave.left_bend"] == ("left_bend" if whole else "bend")
    facts = dict(load_facts(rig, command_delays(rig)))
    assert "position_range [-1.2, 1.2], joint" in facts["limits of slave.left"]
    values["slave"]["axes"]["left_turn"]["joint"] = "wrist"
    path.write_text(json.dumps(values))
    with pytest.raises(ConfigError, match=r"left_turn\.joint: there is no joint 'wrist' in"):
        load_rig(path)


REFUSED = (
    ("slave.arm={dh: [{a: 0.1, mass: 0.1}]}", "slave: give either arm, or arms by name"),
    ("slave.arms={}", "Input should have at least 1 item (got 0)"),
    (
        "slave.arms={left: {dh: [{}, {mass: 0.1}]}}",
        "slave.axes.right_turn: is a joint of none of the slave's arms; begin its name with left_",
    ),
    (
        "slave.arms={left: {dh: [{}, {mass: 0.1}]}, right: {dh: [{}, {mass: 0.1}]}, "
        "right_turn: {dh: [{mass: 0.1}]}}",
        "1 joints (row 1) for 0 axes (); each axis of the side whose name begins with right_turn_ "
        "is a joint",
    ),
    (
        "slave.arms.left.dh=[{a: 0.1, mass: 0.1}]",
        "1 joints (row 1) for 2 axes (left_turn, left_bend); each axis of the side whose name "
        "begins with left_ is a joint",
    ),
    (
        "slave.axes.left_turn.kind=linear",
        "joint 'row 1' of the arm turns, so this should be rotary (got linear)",
    ),
    (
        "simulation.arms.slave={dh: [{}, {}]}",
        "the rig has no such arm; use master.left, master.right, slave.left, slave.right",
    ),
    (
        'simulation.arms={"slave.middle": {dh: [{}, {}]}}',
        "simulation.arms.slave.middle: the rig has no such arm; use master.left",
    ),
    (
        "simulation.arms={left: {dh: [{}, {}]}}",
        "use master or slave here or, for one of several arms, its full name, such as master.left",
    ),
    (
        "slave.axes.left_turn.bus=slave_right",
        "slave.arms.left: a simulated arm needs all of its axes on one bus",
    ),
    (
        "slave.axes.left_turn.load={constant: 0.1}",
        "the chain of arm slave.left already defines the weight; remove it",
    ),
    (
        "slave.arms.left.payloads={box: {mass: 0.1}}",
        "payloads are selected with the command `payload`; add",
    ),
)


@pytest.mark.sparse(3)
@pytest.mark.parametrize(("override", "said"), REFUSED, ids=[said[:40] for _, said in REFUSED])
def test_wrong_arms_are_refused_with_their_place(override: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        rig_of(tree(), override)
    assert any(said in problem for problem in caught.value.problems), caught.value.problems


def test_one_arm_is_not_felt_at_two() -> None:
    values = tree()
    del values["slave"]["arms"]
    rows = [row for arm in ARMS for row in chain(arm, "slave")["dh"]]
    values["slave"]["arm"] = {"dh": rows, "reflect_load": True}
    with pytest.raises(ConfigError, match=r"slave\.arm\.reflect_load: .* led by 2 arms of the"):
        rig_of(values)


def test_an_axis_is_not_a_joint_of_two() -> None:
    values = tree()
    values["slave"]["arms"]["right_of"] = chain("left", "slave")
    for joint in JOINTS:
        values["slave"]["axes"][f"right_of_{joint}"] = values["slave"]["axes"][f"left_{joint}"]
    with pytest.raises(ConfigError) as caught:
        rig_of(values)
    said = "begins with the names of two arms, right_ and right_of_; rename one of them"
    assert sum(said in problem for problem in caught.value.problems) == 2
