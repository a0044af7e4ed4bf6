"""A drive's fault or a lost device holds an operated rig; a person has it reset and goes on."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tautwave.runtime.operate import states as st
from tests.rigs.running import Tree, rig_of
from tests.rigs.test_canopen_rows import can_tree
from tests.rigs.test_dynamixel_rows import ONE, TWO, axis, rig_tree, servos
from tests.rigs.test_modbus_rows import one_rate_tree
from tests.runtime.operating import Operated, operate

STAND = {"type": "minimum_jerk", "waypoints": [[0, 0], [1, 0.01]]}


def servo_tree(*events: Tree, **line: Any) -> Tree:
    bus = servos(ONE, TWO, simulator={"faults": {"events": list(events)}}, **line)
    data = rig_tree({"line": bus}, axis("line", 1), axis("line", 2))
    data.setdefault("loop", {})["missing_limit"] = 20
    return data


def drive_tree() -> Tree:
    fault = {"fault_at_s": 0.5, "fault_code": 0x4310}
    return can_tree(simulator={"nodes": {2: fault}})


def modbus_tree() -> Tree:
    data = one_rate_tree("dsy-rs")
    event = {"kind": "drive_fault", "at_s": 0.5, "unit": 2, "code": 0x4310}
    data["buses"]["arm"]["options"]["simulator"] = {"faults": {"events": [event]}}
    return data


def operated(data: Tree, script: str, duration_s: float) -> Operated:
    """Run it with a hand that stands still, so that it engages at once."""
    data["operate"] = {}
    for hand in data["simulation"]["hand"].values():
        hand["reference"] = STAND
    data["simulation"]["environment"] = {}
    return operate(rig_of(data), script, duration_s)


AGAIN = "0.1 engage\n0.7 engage\n0.8 rest\n0.9 engage"
REMOVED = ({"kind": "remove", "at_s": 0.5, "id": 2}, {"kind": "restore", "at_s": 0.7, "id": 2})
PULLED = ({"kind": "unplug", "at_s": 0.5}, {"kind": "replug", "at_s": 0.7})


@pytest.mark.parametrize(
    ("data", "words"),
    [
        pytest.param(
            drive_tree(), "0x4310", id="canopen: fault of a drive", marks=pytest.mark.slow
        ),
        pytest.param(modbus_tree(), "fault", id="modbus: fault of a drive", marks=pytest.mark.slow),
        pytest.param(servo_tree(*REMOVED), "no sample in 20", id="dynamixel: a servo away"),
        pytest.param(
            servo_tree(*PULLED), "unplugged", id="dynamixel: adapter", marks=pytest.mark.slow
        ),
        pytest.param(
            servo_tree({"kind": "overload", "at_s": 0.5, "id": 2}, reboot=True),
            "overloaded",
            id="dynamixel: overload",
            marks=pytest.mark.slow,
        ),
    ],
)
def test_a_person_has_the_devices_reset_and_engages_again(data: Tree, words: str) -> None:
    done = operated(data, AGAIN, 2.5)
    assert done.result.error is None
    said = list(dict.fromkeys(done.words()))  # a fault may be reported by drive and bus
    assert said == [
        ("engage", "aligning"), ("aligned", "engaged"), ("fault", "holding"),
        ("engage", "holding"), ("rest", "holding"), ("rest", "idle"),
    ]  # fmt: skip
    assert done.words()[-2:] == said[:2]
    texts = [entry.text for entry in done.control.journal.entries]
    assert any(words in text for text in texts)
    assert "the devices are back" in texts
    assert done.control.journal.engagements == 2
    assert np.abs(done.residual()).max() <= 1e-11


def test_a_servo_in_fault_carries_no_load_until_it_is_reset() -> None:
    data = servo_tree({"kind": "overload", "at_s": 0.5, "id": 2}, reboot=True)
    data["slave"]["axes"]["a"]["load"] = {"constant": -0.05}
    done = operated(data, AGAIN, 2.0)
    assert done.result.error is None
    time_s, state = done.columns["time_s"], done.columns["operation.state"]
    effort = done.columns["load.slave.a.effort"]
    fault = float(time_s[np.flatnonzero(state == 4)[0]])
    assert 0.5 <= fault < 0.6
    assert effort[(time_s > 0.1) & (time_s < 0.5)] == pytest.approx(0.05, rel=0.1)
    assert not effort[(time_s > fault + 0.01) & (time_s < 0.8)].any()
    assert effort[-1] == pytest.approx(0.05, rel=0.1)
    assert np.abs(done.residual()).max() <= 1e-11


def test_what_is_not_there_stays_held_and_says_why() -> None:
    done = operated(servo_tree(REMOVED[0]), "0.1 engage\n0.8 rest\n1.8 rest\n2.8 engage", 3.2)
    assert done.result.error is None
    assert done.control.standing == st.Standing(st.HOLDING, True)
    said = [entry.text for entry in done.control.journal.entries]
    assert sum("the devices have not recovered: " in text for text in said) == 2
    assert "servo 2" in "".join(said)
    assert said[-1] == "engage: not possible after a fault; see what failed, then give rest"
    master = done.columns["master.a.commanded"]
    assert not master[done.columns["time_s"] > 0.8].any()
