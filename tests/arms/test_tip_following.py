"""The tip of an arm whose joints follow velocities: books, gate, limits, keys, runs."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tautwave import simulate
from tautwave.config import load_rig
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave.registry import load_driver
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay
from tautwave_drivers.arm.options import coordinates
from tests.arms.motions import FOLLOWING, move
from tests.arms.test_tip import (
    PLANAR,
    PLUGIN,
    SPATIAL,
    Joints,
    made,
    options_of,
    place_of,
)
from tests.arms.test_verdicts import elements

HELD = "simulation.environment={x: {type: spring, stiffness: 80.0, position: 0.02}}"
LEVELS = (0.30, 0.25)


def following(monkeypatch: pytest.MonkeyPatch, *more: str) -> tuple[Any, Joints]:
    return made(monkeypatch, PLANAR, "arm", *FOLLOWING, *more)


def derivative(shoulder: float, elbow: float) -> Any:
    """Return that of x and y of two links in a plane."""
    a, b = LEVELS
    one, both = shoulder, shoulder + elbow
    return np.array(
        [
            [-a * math.sin(one) - b * math.sin(both), -b * math.sin(both)],
            [a * math.cos(one) + b * math.cos(both), b * math.cos(both)],
        ]
    )


def columns(driver: Any) -> dict[str, float]:
    row = [0.0] * len(driver.columns)
    driver.fill(row, 0)
    return dict(zip(driver.columns, row, strict=True))


def test_efforts_and_velocities_go_through_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, joints = following(monkeypatch)
    at = (-0.3, 1.6)
    force = np.array([3.0, -2.0])
    joints.positions, joints.efforts = at, tuple(derivative(*at).T @ force)
    states = driver.read(0)
    assert [state.effort for state in states] == pytest.approx(force)
    assert [state.position for state in states] == pytest.approx([0.0, 0.0], abs=1e-12)
    driver.write([AxisCommand(0.0, 0.1), AxisCommand(0.0, -0.2)])
    speeds = [command.velocity for command in joints.written[-1]]
    assert derivative(*at) @ speeds == pytest.approx([0.1, -0.2])
    assert all(command.effort == 0.0 for command in joints.written[-1])


def test_what_weighs_is_taken_off_what_the_joints_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    upright = "buses.arm.options.chain.gravity=[0.0, -9.81, 0.0]"
    driver, joints = following(monkeypatch, upright)
    joints.positions = (0.4, 0.7)
    one, both = 0.4, 1.1
    elbow = 9.81 * 0.3 * 0.13 * math.cos(both)  # centres are given back from the links' ends
    shoulder = elbow + 9.81 * (0.4 * 0.15 + 0.3 * 0.30) * math.cos(one)
    joints.efforts = (-shoulder, -elbow)
    assert [state.effort for state in driver.read(0)] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_sample_without_an_effort_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, joints = following(monkeypatch)
    joints.positions = (-0.3, 1.6)
    assert [state.valid for state in driver.read(0)] == [False, False]
    driver.write([AxisCommand(0.0, 1.0)] * 2)
    assert list(joints.written[-1]) == [SAFE_COMMAND] * 2
    joints.efforts = (0.0, 0.0)
    driver.read(1_000_000)
    driver.write([SAFE_COMMAND] * 2)
    assert joints.written[-1][0] is SAFE_COMMAND
    driver.write([AxisCommand(0.0, math.nan), AxisCommand(0.0, 0.1)])
    assert list(joints.written[-1]) == [AxisCommand(0.0, 0.0)] * 2


def test_no_joint_is_asked_for_more_than_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stretched out, at any speed of the tip; the whole motion shrinks."""
    driver, joints = following(monkeypatch, "buses.arm.options.home=[0.0, 0.001]")
    joints.positions, joints.efforts = (0.0, 0.001), (0.0, 0.0)
    driver.read(0)
    driver.write([AxisCommand(0.0, -50.0), AxisCommand(0.0, 30.0)])
    speeds = [abs(command.velocity) for command in joints.written[-1]]
    assert max(speeds) == pytest.approx(0.9 * 20)


def test_what_a_turn_is_worth_as_a_lever(monkeypatch: pytest.MonkeyPatch) -> None:
    joints = Joints()
    inner = load_driver("loopback")._replace(make=lambda *given: joints)
    monkeypatch.setattr("tautwave_drivers.arm.behind.load_driver", lambda name: inner)
    options = options_of(SPATIAL, "arm", "buses.arm.options.walls={}")
    axes = tuple(
        AxisSpec(
            f"slave.{k}",
            k,
            "linear" if k < 4 else "rotary",
            "admittance",
            9.0,
            position_range=(-1.0, 1.0),
        )
        for k in range(1, 7)
    )
    driver = PLUGIN.make(options, BusSpec("arm", axes, 1000.0), None, None)  # type: ignore[arg-type]
    joints.positions, joints.efforts = options.at_home, (0.0,) * 7
    driver.read(0)
    _, jacobian = place_of(options.task(), options.at_home)
    scaled = np.diag([1.0] * 3 + [0.2] * 3) @ jacobian
    least = np.linalg.svd(scaled, compute_uv=False)[-1]
    assert columns(driver)["tip.arm.lever"] == pytest.approx(least)


def test_what_is_under_way_leaves_so_much_less_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Commands that each may give the same, of which none acts yet: nothing moves."""
    way = AxisCommand(0.0, -0.4), AxisCommand(0.0, 0.0)
    back = AxisCommand(0.0, 0.4), AxisCommand(0.0, 0.0)

    def room(reserve: float, *commands: Any) -> list[float]:
        driver, joints = following(
            monkeypatch, "buses.arm.options.home=[0, 0.05]", f"buses.arm.options.reserve={reserve}"
        )
        joints.positions, joints.efforts = (0.0, 0.05), tuple(derivative(0.0, 0.05).T @ (60.0, 0.0))
        found = []
        for k, one in enumerate(commands):
            if isinstance(one, float):  # a reset, with so much in the account
                driver._mapped = one
                driver.open()
                continue
            driver.read(1_000_000 * k)
            driver.write(one)
            found.append(columns(driver)["tip.arm.allowed"])
        found.append(driver._unseen)
        return found

    gift = room(10.0, way)[-1]
    assert gift > 1e-4
    assert room(2.5 * gift, way, way, way, way)[:4] == [1.0] * 4
    monkeypatch.setattr(Joints, "command_delay", CommandDelay(1, 0.5e-3))
    assert room(2.5 * gift, way, way, way)[:3] == pytest.approx([1.0, 1.0, 0.5])
    assert room(0.5 * gift, back, way)[:2] == pytest.approx([1.0, 0.5])
    assert room(2.5 * gift, way, way, (SAFE_COMMAND,) * 2, way)[3] == 1.0
    assert room(2.5 * gift, way, way, 0.0, way, way, way)[2:5] == pytest.approx([1.0, 1.0, 0.5])
    assert room(2.5 * gift, way, way, -gift, way, way, way)[2:5] == pytest.approx([1.0] * 3)
    fast = [AxisCommand(0.0, 1000.0 * command.velocity) for command in way]
    assert room(50.0 * gift, fast)[0] == 1.0  # counted as far as the joints' limits let it


@pytest.mark.parametrize(("delay", "missed"), [(0, 0), (8, 0), (0, 19)])
def test_what_a_lagging_tip_gives_out_is_gated(
    monkeypatch: pytest.MonkeyPatch, delay: int, missed: int
) -> None:
    """An elbow that is pushed where it has hardly a lever, and led to and fro with the push.

    The gate lets through what the reserve covers; without it the run is stopped. Commands of
    `delay` periods count that do not act yet, and those that `missed` samples did not show.
    """
    monkeypatch.setattr(Joints, "command_delay", CommandDelay(delay, 0.0))

    def pump(reserve: str) -> tuple[float, float, Any]:
        driver, joints = following(
            monkeypatch, "buses.arm.options.home=[0.0, 0.05]", f"buses.arm.options.{reserve}"
        )
        at, allowed = np.array([0.0, 0.05]), 1.0
        acting = [np.zeros(2)] * delay
        for k in range(400):
            turn = derivative(*at)
            seen = k % (missed + 1) == 0
            joints.positions = tuple(at) if seen else (math.nan, at[1])
            joints.efforts = tuple(turn.T @ np.array([-60.0, 0.0]))
            driver.read(1_000_000 * k)
            driver.write([AxisCommand(0.0, 0.4 * (-1) ** (k // 20)), AxisCommand(0.0, 0.0)])
            row = columns(driver)
            allowed = min(allowed, row["tip.arm.allowed"])
            acting.append(np.array([command.velocity for command in joints.written[-1]]))
            at = at + 1e-3 * acting.pop(0)
            at[1] = 0.05  # something holds the elbow there
        return row["tip.arm.mapped_given"], allowed, driver.faults()

    most, allowed, faults = pump("reserve=0.0002")
    assert not faults
    assert allowed < 1.0
    assert 2e-5 < most < 3e-4
    most, allowed, _ = pump("reserve=10.0")
    assert allowed == 1.0
    assert most > 1e-3


def test_books_that_are_far_overdrawn_stop_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """Stretched out, something bends the elbow against its drives: at the tip nothing shows."""
    driver, joints = following(
        monkeypatch, "buses.arm.options.home=[0, 0]", "buses.arm.options.reserve=1e-3"
    )
    faults: list[Any] = []
    for k in range(6):
        joints.positions = (-0.25e-3 * k, 0.55e-3 * k)
        joints.efforts = (1.0, -2.2)
        driver.read(1_000_000 * k)
        faults += driver.faults()
    (fault,) = faults
    assert "reserve is 0.001" in fault.text
    assert fault.fatal


def test_an_account_that_is_not_a_number_is_overdrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """Efforts of which each is finite, and their work is not."""
    driver, joints = following(monkeypatch)
    joints.efforts = (1e308, -1e308)
    for k in range(2):
        joints.positions = (-0.3 + 1e-3 * k, 1.6)
        driver.read(1_000_000 * k)
        driver.write([AxisCommand(0.0, 0.1)] * 2)
    assert math.isnan(columns(driver)["tip.arm.mapped"])
    assert list(joints.written[-1]) == [AxisCommand(0.0, 0.0)] * 2
    (fault,) = driver.faults()
    assert "the arm supplied nan J" in fault.text


def test_a_sample_that_is_missing_makes_no_joint_faster(monkeypatch: pytest.MonkeyPatch) -> None:
    for more in (FOLLOWING, ()):
        driver, joints = made(monkeypatch, PLANAR, "arm", *more)
        joints.efforts = (0.0, 0.0)
        for k in range(6):
            joints.positions = (-0.3 + 0.012 * k, math.nan if k == 3 else 1.6)
            driver.read(1_000_000 * k)
        assert driver.faults() == []
        joints.positions = (-0.3 + 0.072 + 0.009, 1.6)
        driver.read(6_000_000)
        (fault,) = driver.faults()
        assert "moves at 21, beyond its velocity_limit 20" in fault.text


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("buses.arm.options.posture=0.5", "posture: a joint spring needs effort-controlled joints"),
        (
            "buses.arm.options.walls={floor: {shape: plane, normal: [0, 0, 1], stiffness: 1}}",
            "walls: walls in space need effort-controlled joints",
        ),
        ("buses.arm.options.reserve=0", "greater than 0"),
        ("buses.arm.options.least_lever=1e-6", "greater than or equal to 0.001"),
    ],
)
def test_what_such_joints_have_no_use_for_is_refused(more: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(PLANAR, [*FOLLOWING, more])
    assert said in str(caught.value.problems)


def test_coordinates_are_all_of_one_causality() -> None:
    axes = tuple(
        AxisSpec(f"slave.{name}", number, "linear", causality, 10.0)
        for name, number, causality in (("x", 1, "impedance"), ("y", 2, "admittance"))
    )
    with pytest.raises(ConfigError, match="give all coordinates the same causality"):
        coordinates(BusSpec("arm", axes, 1000.0))


def test_joints_that_take_effort_have_to_have_inertia() -> None:
    with pytest.raises(
        ConfigError, match=r"elbow\.inertia_lower: required for an " r"effort-controlled joint"
    ):
        load_rig(PLANAR, ["buses.arm.options.joints.elbow.inertia_lower=0"])


def test_friction_that_no_simulated_drive_has_is_refused() -> None:
    more = "buses.arm.options.truth.joints.shoulder.coulomb=0.1"
    rig = load_rig(PLANAR, [*FOLLOWING, more])
    with pytest.raises(ConfigError, match=r"truth\.joints\.shoulder\.coulomb: a simulated joint"):
        simulate(rig, duration_s=0.01)


def test_the_verdict_states_reserve_and_conditions() -> None:
    tip = elements(PLANAR, *FOLLOWING)["tip of arm"]
    assert tip.passive.passed
    assert "may supply 0.01 J beyond" in tip.passive.reason
    assert "their weight subtracted" in tip.passive.conditions[0]


def test_a_following_tip_moves_and_its_books_are_the_truth() -> None:
    found = simulate(load_rig(PLANAR, [*FOLLOWING, HELD]), duration_s=0.25)
    assert found.error is None
    pushed = found["true.slave.x.environment_effort"]
    moved = np.diff(found["true.slave.x.position"])
    given = -float(np.sum(0.5 * (pushed[1:] + pushed[:-1]) * moved))
    booked = -sum(found[f"slave.{c}.port_energy"][-1] for c in "xy")
    assert abs(given) > 1e-3  # J: the spring did some work
    assert booked + found["tip.arm.mapped"][-1] == pytest.approx(given, rel=2e-3)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_following_tips_go_through_singular_poses_within_what_was_claimed() -> None:
    """`python -m tests.arms.motions --following --count 1000` has more of them."""
    motions = [move(seed, following=True) for seed in (0, 3, 5)]
    assert all(motion.given < 1e-3 * motion.claimed for motion in motions)
    assert min(motion.singular for motion in motions) < 0.01
