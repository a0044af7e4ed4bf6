"""The shipped gripper, whose servo takes positions: what is felt, where it waits, and claims."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import yaml

from tautwave.certificate import Element
from tautwave.config import Rig, bus_spec, load_rig
from tautwave.config.keys.calibration import AxisCalibration, Calibration
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.couplings.wave.certificate import admittance_element
from tautwave.laws.servo.follower import FollowerParams
from tautwave.rig import command_delays
from tautwave.rig.calibrated import CalibratedDriver, calibrated
from tautwave.runtime.following import FollowingDriver
from tautwave.runtime.sensing import LoopBus
from tautwave.truth import PositionLoop
from tautwave.types import AxisCommand, CommandDelay, JointState
from tautwave_sim.axis import SimulatedAxis
from tests.certificate.rigs import CONFIGS
from tests.rigs.running import Run, Tree, rig_of, run_rig, tree
from tests.sim.truths import truth

GRIPPER = "bench-gripper-loopback"
HAND = "simulation.hand.gripper.reference.waypoints"
QUIET: Tree = {
    "slave.axes.gripper.encoder_quantum": 0.0,
    "coupling.release_ramp_s": 0.0,
    "duration_s": 1.0,
    HAND: [[0.1, 0.0], [0.6, 0.7]],
}


def alone(*changes: Tree) -> Rig:
    """Return the rig without its elbow."""
    base = yaml.safe_load((CONFIGS / f"{GRIPPER}.yaml").read_text())
    places = ["master.axes", "slave.axes", "coupling.pairs", "simulation.hand"]
    places += ["simulation.axes.master/", "simulation.axes.slave/"]
    less: Tree = {f"{at}{'' if at.endswith('/') else '.'}elbow": None for at in places}
    return rig_of(tree(QUIET, *changes, less, base=base))


@pytest.fixture(scope="module")
def held() -> Run:
    """The finger has closed on the object, and stands there."""
    return run_rig(alone())


def port_of(found: Rig) -> Element:
    return admittance_element(found, "slave.gripper", command_delays(found), None)


def test_the_hand_feels_the_spring_between_goal_and_finger(held: Run) -> None:
    goal, finger = held["slave.gripper.position"], held["slave.gripper.followed"]
    assert finger[-1] == pytest.approx(0.45, abs=0.02), "at the object"
    assert goal[-1] - finger[-1] > 0.05
    np.testing.assert_allclose(held["slave.gripper.measured_effort"][1:], (finger - goal)[1:])
    assert held["master.gripper.port_effort"][-1] == pytest.approx(goal[-1] - finger[-1], rel=0.02)
    # Its own drive has the same stiffness here; only Coulomb friction comes between.
    squeeze = -held["true.slave.gripper.environment_effort"][-1]
    assert squeeze == pytest.approx(goal[-1] - finger[-1], abs=0.006)


@pytest.mark.slow
def test_the_goal_waits_at_the_effort_limit_and_a_weak_drive_lags_there() -> None:
    weak = {"simulation.axes.slave/gripper.effort_limit": 0.02}
    run = run_rig(alone(weak, {"slave.axes.gripper.effort_limit": 0.05}))
    ahead = run["slave.gripper.position"] - run["slave.gripper.followed"]
    assert ahead[-1] == pytest.approx(0.05, rel=1e-6)
    assert ahead.max() < 0.052, "the finger may come back within a period"
    assert -run["true.slave.gripper.environment_effort"][-1] < 0.026
    assert run["master.gripper.port_effort"][-1] > 0.1, "a goal that waits is a hard stop"


@pytest.mark.slow
def test_a_stop_holds_the_grip() -> None:
    strong = {"simulation.hand.gripper.stiffness": 5000.0, "coupling.release_ramp_s": 0.3}
    reach = {HAND: [[0.1, 0.0], [0.7, 0.7], [0.9, 3.0]]}
    run = run_rig(alone(strong, reach), raises=False)
    assert run.result.error is not None, "the trigger left its range"
    goal = run["slave.gripper.position"]
    assert goal[-1] - run["slave.gripper.followed"][-1] > 0.05
    assert goal[-1] == pytest.approx(goal[-20], abs=1e-9)


def test_the_certificate_is_conditional_and_says_what_it_leaves_out() -> None:
    port = port_of(alone())
    assert port.kind == "follower"
    assert port.passive.state == "conditional"
    assert any("not part of any claim" in one for one in port.passive.conditions)
    assert any("without overshoot" in one for one in port.passive.conditions)
    assert "not certified" in port.passive.reason


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"slave.axes.gripper.follower.lag_s": 0.01}, "overshoots its goal"),
        ({"simulation.axes.slave/gripper.servo_damping": 0.05}, "lags by 50 ms"),
        ({"buses.arm.options": {"command_delay_s": 0.003}}, "a whole number of periods"),
    ],
)
def test_a_simulated_device_that_is_not_as_believed_fails(change: Tree, says: str) -> None:
    found = port_of(alone(change)).passive
    assert says in found.reason
    assert not found.passed


class Recorder:
    """A driver that keeps what it gets; its devices, one as a rule, are at `place`."""

    def __init__(self, delay: CommandDelay) -> None:
        self.command_delay = delay
        self.sent: list[float] = []
        self.place = 0.0
        self.valid = True
        self.devices = 1

    def open(self) -> None: ...
    def enable_step(self) -> bool:
        return True

    def request(self) -> None: ...
    def read(self, deadline_ns: int) -> list[JointState]:
        return [JointState(self.place, 0.0, float("nan"), self.valid, 0)] * self.devices

    def write(self, commands: list[AxisCommand]) -> None:
        self.sent = [command.position for command in commands]

    def faults(self) -> tuple[()]:
        return ()

    def disable(self) -> None: ...
    def close(self) -> None: ...


WIDE = FollowerParams(0.01, 2.0, 10.0, -10.0, 10.0)


@pytest.mark.parametrize(("delay", "late"), [(0, 0.0), (1, 0.0), (3, 0.0), (1, 0.25)])
def test_the_device_is_sent_ahead_of_a_goal_that_is_delayed(delay: int, late: float) -> None:
    inner = Recorder(CommandDelay(delay, late * WIDE.period))
    driver = FollowingDriver(inner, ["slave.a"], [WIDE])
    driver.open()
    inner.place = 0.5
    goals = []
    for _ in range(12):
        [state] = driver.read(0)
        goals.append(state.position)
        assert state.effort == pytest.approx(2.0 * (0.5 - state.position))
        driver.write([AxisCommand(0.0, 1.0)])
    assert inner.sent == [pytest.approx(0.5 + 12 * 0.01)]
    slots = np.arange(12) - delay - late
    np.testing.assert_allclose(goals, 0.5 + 0.01 * np.maximum(slots, 0.0))


def test_nothing_is_sent_before_a_first_sample_and_a_missed_one_stays_missed() -> None:
    inner = Recorder(CommandDelay(0, 0.0))
    inner.valid = False
    driver = FollowingDriver(inner, ["slave.a"], [WIDE])
    driver.open()
    assert not driver.read(0)[0].valid
    driver.write([AxisCommand(0.0, 1.0)])
    assert np.isnan(inner.sent[0])
    inner.valid, inner.place = True, 1.0
    assert driver.read(0)[0].position == 1.0
    driver.write([AxisCommand(0.0, 1.0)])
    assert inner.sent == [pytest.approx(1.01)]


def test_a_calibrated_device_is_sent_where_it_counts() -> None:
    inner = Recorder(CommandDelay(0, 0.0))
    found = AxisCalibration(zero=0.3, direction=-1)
    driver = CalibratedDriver(inner, ["slave.a"], [found], followers=True)
    inner.place = 0.1
    [state] = driver.read(0)
    assert state.position == pytest.approx(0.2)
    driver.write([AxisCommand(0.0, 0.0, state.position)])
    assert inner.sent == [pytest.approx(0.1)]


def test_a_bus_is_turned_where_one_of_its_axes_was_calibrated() -> None:
    plain = load_rig(CONFIGS / f"{GRIPPER}.yaml")
    inner: Any = Recorder(CommandDelay(0, 0.0))
    inner.place, inner.devices = 0.1, 2
    hand, arm = (
        LoopBus(name, inner, [f"{side}.elbow", f"{side}.gripper"], 3)
        for name, side in (("hand", "master"), ("arm", "slave"))
    )
    assert calibrated(plain, arm) is arm
    found = Calibration(axes={"slave.gripper": AxisCalibration(zero=0.3)})
    rig = plain.model_copy(update={"calibration": found})
    assert calibrated(rig, hand) is hand
    turned = calibrated(rig, arm)
    assert isinstance(turned.driver, CalibratedDriver)
    assert turned._replace(driver=inner) == arm
    places = [state.position for state in turned.driver.read(0)]
    assert places == pytest.approx([0.1, -0.2], rel=1e-12)
    turned.driver.write([AxisCommand(0.0, 0.0, place) for place in places])
    assert inner.sent == pytest.approx([0.1, 0.1], rel=1e-12)  # the gripper takes positions


def test_a_simulated_position_loop_lags_as_its_numbers_say_and_stays_without_a_goal() -> None:
    slow = truth(mass=1e-4, quantum=0.0)
    axis = SimulatedAxis("slave.a", slow, PositionLoop(1.0, 0.03))
    axis.command(float("nan"))
    for _ in range(5):
        axis.pass_slot()
    assert axis.physics.x == 0.0
    for slot in range(400):
        axis.command(0.5 * 1e-3 * (slot + 1))
        axis.pass_slot()
    # Sent ahead by a slot and held for it: half a slot of the 30 ms is saved.
    assert 0.5 * 0.4 - axis.physics.x == pytest.approx(0.5 * (0.03 - 0.5e-3), rel=2e-2)


def test_the_bus_of_a_follower_knows_that_it_takes_positions() -> None:
    spec: BusSpec = bus_spec(load_rig(CONFIGS / f"{GRIPPER}.yaml"), "arm")
    takes: list[bool] = [axis.takes_position for axis in spec.axes]
    assert takes == [False, True]
    assert not AxisSpec("master.a", 1, "rotary", "impedance", 1.0).takes_position
