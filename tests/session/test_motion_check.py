"""The motion check of an acceptance: small pushes both ways tell every turned sign."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.cli.rigs import accept as command
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError, DeviceFault
from tautwave.runtime.sensing import LoopBus
from tautwave.session.acceptance.accepted import accepted_path, comparing, keep_accepted
from tautwave.session.acceptance.document import Check
from tautwave.session.acceptance.ladder import SEEN, STAGES, TOUCH, touches
from tautwave.session.acceptance.motion import MAX_SHARE, MAX_SPEED, TOO_FAR, motions
from tautwave.session.guided.answers import Misread, confirmed
from tautwave.session.guided.control import GuidedControl
from tests.examples import tried
from tests.session.test_calibrating import BENCH

AXIS = "master.lever"
PERIOD_NS = 1_000_000


class Device:
    """A mass with friction under a guide; signs of what it tells may be turned."""

    def __init__(
        self,
        inertia: float = 1e-3,
        coulomb: float = 0.0,
        damping: float = 0.0,
        *,
        position: int = 1,
        velocity: float = 1.0,
        effort: float = 1.0,
        commands: int = 1,
    ) -> None:
        self.inertia, self.coulomb, self.damping = inertia, coulomb, damping
        self.signs = position, velocity, effort, commands
        self.run = SimpleNamespace(period_ns=PERIOD_NS)
        self.now_ns = 0
        self.x = self.v = self.pushed = self.most = self.travel = 0.0

    def ask(self, question: str) -> Any:
        yield
        return ""

    def position(self, name: str) -> float:
        return self.signs[0] * self.x

    def velocity(self, name: str) -> float:
        return self.signs[0] * self.v

    def push(self, name: str, effort: float) -> None:
        self.pushed = effort
        self.most = max(self.most, abs(effort))

    def witness(self, name: str) -> tuple[float, float]:
        return self.signs[1] * self.v, self.signs[2] * self.signs[3] * self.pushed

    def pass_slot(self) -> None:
        for _ in range(2):
            effort = self.signs[3] * self.pushed
            friction = self.coulomb if self.v else min(self.coulomb, abs(effort))
            drag = math.copysign(friction, self.v or effort) + self.damping * self.v
            v = self.v + (effort - drag) / self.inertia * 5e-4
            self.v = 0.0 if self.v * v < 0.0 and abs(effort) <= self.coulomb else v
            self.x += self.v * 5e-4
        self.travel = max(self.travel, abs(self.x))
        self.now_ns += PERIOD_NS


def bench() -> Rig:
    return load_rig(BENCH)


RIG = bench()
LIMIT = RIG.axes[AXIS].effort_limit


def checked(device: Device) -> list[Check]:
    guide = motions(RIG, [AXIS], cast(GuidedControl, device))
    while True:
        try:
            next(guide)
        except StopIteration as ended:
            return list(ended.value)
        device.pass_slot()


@settings(max_examples=tried(30))
@given(
    inertia=st.floats(1e-4, 1e-1),
    coulomb=st.floats(0.0, 0.15 * LIMIT),
    damping=st.floats(0.0, 1e-2),
)
def test_a_device_that_goes_the_right_way_passes_and_stays_near(
    inertia: float, coulomb: float, damping: float
) -> None:
    device = Device(inertia, coulomb, damping)
    found = checked(device)
    assert [check.what for check in found] == [f"{AXIS} forward", f"{AXIS} back"]
    assert all(check.good for check in found), found
    assert device.travel <= TOO_FAR["rotary"]
    assert device.most <= MAX_SHARE * LIMIT * (1.0 + 1e-9)
    assert device.pushed == 0.0


@pytest.mark.parametrize(
    ("signs", "against"),
    [
        ({"position": -1}, "position"),
        ({"position": -1, "velocity": -1.0}, "position, velocity"),  # 607Eh, torque as it was
        ({"velocity": -1.0}, "velocity"),
        ({"effort": -1.0}, "motor effort"),
        ({"commands": -1}, "position, velocity, motor effort"),
        ({"velocity": math.nan, "effort": math.nan}, ""),
        ({"effort": 0.0}, ""),
    ],
)
def test_every_turned_sign_is_named(signs: dict[str, Any], against: str) -> None:
    device = Device(coulomb=0.02 * LIMIT, **signs)
    for check in checked(device):
        assert check.good == (not against), check
        assert check.measured.get("against the push", "") == against
    assert device.travel <= TOO_FAR["rotary"]


def test_a_device_that_does_not_move_is_not_good() -> None:
    assert not any(check.good for check in checked(Device(coulomb=LIMIT)))


# -- what is kept, and compared ------------------------------------------------------------------


def opened(path: Path, said: dict[str, dict[str, str]]) -> tuple[list[str], Any]:
    rig = RIG.read_from(path)
    driver = SimpleNamespace(identities=said)
    bus = cast(LoopBus, SimpleNamespace(name="arms", axes=[AXIS, "slave.lever"], driver=driver))
    heard: list[str] = []
    return heard, comparing(rig, [bus], heard.append)


BOTH = {AXIS: {"serial": "0x4D", "software": "1.2"}, "slave.lever": {"serial": "0x4E"}}


def test_a_run_compares_devices_with_what_was_accepted(tmp_path: Path) -> None:
    path = tmp_path / "rig.yaml"
    heard, compare = opened(path, BOTH)
    compare()
    compare()  # after a reset
    (sentence,) = heard
    assert sentence.startswith(f"not accepted: {AXIS}, slave.lever; `tautwave accept rig.yaml`")
    keep_accepted(path, {AXIS: BOTH[AXIS]}, "me", tmp_path / "acceptance.json")
    heard, compare = opened(path, BOTH)
    compare()
    assert [one.split(";")[0] for one in heard] == ["not accepted: slave.lever"]
    keep_accepted(path, {"slave.lever": BOTH["slave.lever"]}, "me", tmp_path / "acceptance.json")
    assert json.loads(accepted_path(path).read_text())["devices"] == BOTH
    heard, compare = opened(path, BOTH)
    compare()
    assert heard == []
    changed = BOTH | {AXIS: {"serial": "0x4D", "software": "1.3"}}
    _, compare = opened(path, changed)
    with pytest.raises(DeviceFault, match=rf"{AXIS}: software was 1.2, now 1.3; put it back"):
        compare()
    _, compare = opened(path, {})
    with pytest.raises(DeviceFault, match="serial was 0x4D, now not given"):
        compare()


@pytest.mark.parametrize("text", ["", "[]", '{"devices": 3}', '{"devices": {"a": 1}}'])
def test_a_damaged_file_is_said(tmp_path: Path, text: str) -> None:
    path = tmp_path / "rig.yaml"
    accepted_path(path).write_text(text)
    _, compare = opened(path, BOTH)
    with pytest.raises(ConfigError, match=r"rig\.accepted\.json: was not written by"):
        compare()


def test_a_rig_without_hardware_says_nothing(tmp_path: Path) -> None:
    heard: list[str] = []
    comparing(RIG.read_from(tmp_path / "rig.yaml"), [], heard.append)()
    assert heard == []


class Servo(Device):
    """A drive that takes velocity and follows it after a while; `scale` of what it goes to that."""

    def __init__(self, scale: float = 1.0, lag_s: float = 0.005, **signs: Any) -> None:
        super().__init__(**signs)
        self.scale, self.lag_s = scale, lag_s
        self.wanted = 0.0

    def drive(self, name: str, velocity: float) -> None:
        self.wanted = velocity
        self.most = max(self.most, abs(velocity))

    def pass_slot(self) -> None:
        goal = self.signs[3] * self.scale * self.wanted
        self.v += (goal - self.v) * (1.0 - math.exp(-1e-3 / self.lag_s))
        self.x += self.v * 1e-3
        self.travel = max(self.travel, abs(self.x))
        self.now_ns += PERIOD_NS


VELOCITY = load_rig(BENCH.with_name("bench-admittance-loopback.yaml"))
TAKER = next(name for name, axis in VELOCITY.axes.items() if axis.causality == "admittance")


def driven(device: Servo) -> list[Check]:
    guide = motions(VELOCITY, [TAKER], cast(GuidedControl, device))
    while True:
        try:
            next(guide)
        except StopIteration as ended:
            assert abs(device.wanted) < 1e-12
            return list(ended.value)
        device.pass_slot()


@settings(max_examples=tried(20))
@given(lag_s=st.floats(1e-3, 0.05), scale=st.floats(0.9, 1.1))
def test_an_axis_that_takes_velocity_is_driven_both_ways_and_stays_near(
    lag_s: float, scale: float
) -> None:
    device = Servo(scale, lag_s)
    found = driven(device)
    assert [check.what for check in found] == [f"{TAKER} forward", f"{TAKER} back"]
    assert all(check.good for check in found), found
    assert device.travel <= TOO_FAR["rotary"]
    assert 0.0 < device.most <= MAX_SPEED * VELOCITY.axes[TAKER].velocity_limit
    assert abs(device.x) < 0.2 * device.travel  # it is back


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"position": -1}, "position"),
        ({"velocity": -1.0}, "velocity"),
        ({"commands": -1}, "position, velocity"),
        ({"velocity": math.nan}, ""),
        ({"scale": 1.8}, "ratio"),  # a unit of another scale
        ({"scale": 0.55}, "ratio"),
        ({"scale": 60.0}, "ratio"),  # turns a minute for turns a second
        ({"scale": 0.0}, "position, velocity"),
    ],
)
def test_a_velocity_the_other_way_or_in_other_units_is_told(
    wrong: dict[str, Any], told: str
) -> None:
    device = Servo(**wrong)
    for check in driven(device):
        assert check.good == (not told), check
        if told == "ratio":
            assert cast(float, check.measured["ratio"]) == pytest.approx(device.scale, rel=0.1)
        else:
            assert check.measured.get("against the command", "") == told
    assert device.travel <= TOO_FAR["rotary"]


# -- the first touch -------------------------------------------------------------------------


class Told(Device):
    """A device whose person answers in turn."""

    def __init__(self, *answers: str, **more: Any) -> None:
        super().__init__(**more)
        self.answers = ["", *answers]
        self.asked: list[str] = []

    def ask(self, question: str, read: Callable[[str], str] = confirmed) -> Any:
        while True:
            self.asked.append(question)
            yield
            with suppress(Misread):
                return read(self.answers.pop(0))


def touched(device: Any, rig: Rig, axis: str) -> Check:
    guide = touches(rig, [axis], cast(GuidedControl, device))
    while True:
        try:
            next(guide)
        except StopIteration as ended:
            (check,) = ended.value
            return cast(Check, check)
        device.pass_slot()


@pytest.mark.parametrize(
    ("answers", "more", "good"),
    [
        (["+"], {}, True),
        (["0"], {}, True),
        (["-"], {}, False),
        (["what?", "", "+"], {}, True),
        (["+"], {"position": -1}, False),
        (["+"], {"commands": -1}, False),
        (["0"], {"coulomb": LIMIT}, True),  # friction holds it: the next stages push harder
        (["0"], {"commands": -1}, False),
    ],
)
def test_a_first_touch_is_light_and_goes_the_way_that_was_felt(
    answers: list[str], more: dict[str, Any], good: bool
) -> None:
    device = Told(*answers, **more)
    check = touched(device, RIG, AXIS)
    assert check.good is good, check
    assert check.measured["felt"] == answers[-1]
    assert device.most <= TOUCH * LIMIT * (1.0 + 1e-9)
    assert device.travel <= TOO_FAR["rotary"]
    assert device.pushed == 0.0
    assert len(device.asked) == 1 + len(answers)


def test_every_stage_says_what_has_to_be_seen() -> None:
    assert tuple(SEEN) == STAGES == command.STAGES
