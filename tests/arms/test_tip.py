"""The tip of an arm as the axes of a bus: coordinates, books, limits, verdicts, keys."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave import simulate
from tautwave.certificate import certify
from tautwave.config import load_rig
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave.models.chain.task import at_home, home_place, joint_efforts, task_place
from tautwave.registry import load_driver
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay, JointState
from tautwave_drivers.arm.driver import ArmDriver
from tests.arms.motions import move

CONFIGS = Path(__file__).parents[2] / "configs" / "arms"
PLANAR, SPATIAL = CONFIGS / "planar.yaml", CONFIGS / "six-seven.yaml"
PLUGIN = load_driver("arm")


def options_of(path: Path, bus: str, *more: str) -> Any:
    return PLUGIN.options.model_validate(load_rig(path, list(more)).buses[bus].options)


def place_of(task: Any, q: Sequence[float]) -> tuple[Any, Any]:
    jacobian = [0.0] * (6 * len(q))
    place = task_place(task, q, jacobian)
    return np.array(place), np.array(jacobian).reshape(len(q), 6).T


def postures(options: Any, count: int) -> list[list[float]]:
    rng = random.Random(4)
    ranges = [joint.position_range for joint in options.joints.values()]
    return [[rng.uniform(0.6 * low, 0.6 * high) for low, high in ranges] for _ in range(count)]


@pytest.mark.parametrize("bus", ["hand", "arm"])
def test_the_derivative_of_the_coordinates_is_theirs(bus: str) -> None:
    options = options_of(SPATIAL, bus)
    task = options.task()
    assert place_of(task, options.at_home)[0] == pytest.approx(np.zeros(6), abs=1e-12)
    checked = 0
    for q in postures(options, 40):
        place, jacobian = place_of(task, q)
        if np.linalg.norm(place[3:]) > 2.9:
            continue
        checked += 1
        for j in range(len(q)):
            ends = [
                place_of(task, [at + (h if i == j else 0.0) for i, at in enumerate(q)])[0]
                for h in (1e-6, -1e-6)
            ]
            assert (ends[0] - ends[1]) / 2e-6 == pytest.approx(jacobian[:, j], abs=2e-8)
    assert checked > 20


def test_efforts_on_the_tip_do_the_work_of_the_joints() -> None:
    """tau.dq is F.(J dq) to rounding, and F.dh but for the second order in dq."""
    options = options_of(SPATIAL, "arm")
    task = options.task()
    rng = np.random.default_rng(2)
    for q in postures(options, 20):
        _, jacobian = place_of(task, q)
        force, step = rng.normal(size=6), 1e-3 * rng.normal(size=7)
        efforts = [0.0] * 7
        joint_efforts(list(jacobian.T.ravel()), force, efforts)
        assert np.dot(efforts, step) == pytest.approx(force @ (jacobian @ step), abs=1e-15)
        change = place_of(task, np.array(q) + step)[0] - place_of(task, q)[0]
        assert abs(force @ (change - jacobian @ step)) < 20.0 * np.linalg.norm(force) * step @ step


def test_displacements_summed_drift_and_coordinates_do_not() -> None:
    """Why positions come from kinematics: J dq added up loses millimetres in seconds."""
    options = options_of(PLANAR, "arm")
    task = options.task()
    summed, last = np.zeros(6), np.array(options.at_home)
    for k in range(1, 4001):
        turn = 2 * math.pi * k / 4000
        q = options.at_home + np.array([0.8 * math.sin(7 * turn), 0.8 * math.sin(9 * turn + 1)])
        summed += place_of(task, last)[1] @ (q - last)
        last = q
    drift = np.linalg.norm((summed - place_of(task, last)[0])[:2])
    assert 1e-3 < drift < 0.2


class Joints:
    """A driver of joints that go where they are commanded, and keep their efforts."""

    command_delay = CommandDelay(0, 0.0)
    notes = ("a note",)

    def __init__(self) -> None:
        self.open = self.request = self.disable = self.close = lambda: None
        self.enable_step = lambda: True
        self.positions: Sequence[float] = ()
        self.efforts: Sequence[float] = ()
        self.written: list[Sequence[AxisCommand]] = []

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        efforts = self.efforts or [math.nan] * len(self.positions)
        return [
            JointState(q, math.nan, effort, q == q, 0)
            for q, effort in zip(self.positions, efforts, strict=True)
        ]

    def write(self, commands: Sequence[AxisCommand]) -> None:
        self.written.append(commands)

    def faults(self) -> Sequence[Any]:
        return ()


def made(monkeypatch: pytest.MonkeyPatch, path: Path, bus: str, *more: str) -> tuple[Any, Joints]:
    joints = Joints()
    inner = load_driver("loopback")._replace(make=lambda *given: joints)
    monkeypatch.setattr("tautwave_drivers.arm.behind.load_driver", lambda name: inner)
    rig = load_rig(path, list(more))
    side = "master" if bus == "hand" else "slave"
    axes = tuple(
        AxisSpec(
            name,
            axis.id,
            axis.kind,
            axis.causality,
            axis.effort_limit,
            position_range=axis.position_range or (-1.0, 1.0),
        )
        for name, axis in rig.axes.items()
        if name.startswith(side)
    )
    options = PLUGIN.options.model_validate(rig.buses[bus].options)
    return PLUGIN.make(options, BusSpec(bus, axes, 1000.0), None, None), joints  # type: ignore[arg-type]


@pytest.mark.parametrize("pull", [0.0, 9.81])
def test_home_is_the_first_of_the_postures(monkeypatch: pytest.MonkeyPatch, pull: float) -> None:
    """Two joints in a plane: what they are asked for at home, in closed form.

    `pull` is the share of gravity in the plane [m/s^2].
    """
    monkeypatch.setattr("tautwave_drivers.arm.verdict.POSTURES", 1)
    weighing = f"buses.hand.options.chain.gravity=[0.0, {-pull}, 0.0]"
    rig = load_rig(PLANAR, ["buses.hand.options.posture=0.5", weighing])
    options = PLUGIN.options.model_validate(rig.buses["hand"].options)
    axes = tuple(
        AxisSpec(name, axis.id, axis.kind, "impedance", axis.effort_limit)
        for name, axis in rig.axes.items()
        if name.startswith("master")
    )
    assert PLUGIN.elements is not None
    found = PLUGIN.elements(options, BusSpec("hand", axes, 1000.0), rig.axes, 1.0)
    upper, fore, elbow = 0.18, 0.16, 1.2
    shoulder = 0.6
    tip = [
        (-upper * math.sin(shoulder) - fore * math.sin(shoulder + elbow),
         upper * math.cos(shoulder) + fore * math.cos(shoulder + elbow)),
        (-fore * math.sin(shoulder + elbow), fore * math.cos(shoulder + elbow)),
    ]  # fmt: skip
    # Of 0.1 kg in the middle of the upper arm, 0.08 kg in the middle of the forearm.
    fore_at = 0.5 * fore * math.cos(shoulder + elbow)
    upper_at = upper * math.cos(shoulder)
    weights = [pull * (0.1 * 0.5 * upper_at + 0.08 * (upper_at + fore_at)), pull * 0.08 * fore_at]
    for joint, (x, y), weight in zip(found, tip, weights, strict=False):
        asked = 8.0 * (abs(x) + abs(y)) + 8.0 * math.hypot(x, y)  # axes, then the wall
        asked += abs(weight)
        assert joint.numbers["greatest_effort"] == pytest.approx(asked, rel=1e-9)


def test_the_books_are_what_the_joints_got(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, joints = made(monkeypatch, SPATIAL, "arm")
    rng = np.random.default_rng(1)
    home = np.array(options_of(SPATIAL, "arm").at_home)
    before, acted, forces = None, None, None
    joint_work = tip_work = 0.0
    for k in range(300):
        q = home + 0.2 * np.sin(0.02 * k * np.arange(1, 8) + np.arange(7))
        joints.positions = list(q)
        place = np.array([state.position for state in driver.read(1_000_000 * k)])
        if before is not None:
            joint_work += acted @ (q - before[0])
            tip_work += forces @ (place - before[1])
        before = q, place
        forces = rng.normal(size=6)
        driver.write([AxisCommand(effort, 0.0) for effort in forces])
        acted = np.array([command.effort for command in joints.written[-1]])
    row = dict.fromkeys(driver.columns, 0.0)
    values = list(row.values())
    driver.fill(values, 0)
    row = dict(zip(driver.columns, values, strict=True))
    held = row["tip.arm.potential"] - row["tip.arm.leak"]  # given to the joints by what holds them
    pushed = -row["space.arm.table.absorbed"]
    assert row["tip.arm.mapped"] == pytest.approx(joint_work - held - pushed - tip_work, abs=1e-12)
    assert abs(row["tip.arm.mapped"]) < 1e-2 * np.abs(tip_work)
    assert abs(row["tip.arm.leak"]) < 5e-3
    assert driver.notes == ("a note",)


def test_a_missing_joint_is_a_missing_tip_and_safe_stays_safe(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    driver, joints = made(monkeypatch, PLANAR, "hand")
    joints.positions = (0.6, math.nan)
    assert [state.valid for state in driver.read(0)] == [False, False]
    driver.write([AxisCommand(1.0, 0.0)] * 2)
    assert list(joints.written[-1]) == [SAFE_COMMAND] * 2  # where it is is not known yet
    joints.positions = (0.6, 1.2)
    assert all(state.valid for state in driver.read(1_000_000))
    driver.write([AxisCommand(1.0, 0.0)] * 2)
    assert joints.written[-1][0].effort != 0.0
    driver.write([SAFE_COMMAND] * 2)
    assert joints.written[-1][0] is SAFE_COMMAND


def test_a_joint_beyond_its_limits_is_a_fault_once(monkeypatch: pytest.MonkeyPatch) -> None:
    driver, joints = made(monkeypatch, PLANAR, "hand")
    for k, elbow in enumerate((1.2, 1.2 + 0.03, 1.2 + 0.06)):
        joints.positions = (0.6, elbow)
        driver.read(1_000_000 * k)
    (fault,) = driver.faults()
    assert fault.text == "joint master.elbow moves at 30, beyond its velocity_limit 20"
    assert not driver.faults()
    driver, joints = made(monkeypatch, PLANAR, "hand")
    for k in range(2):
        joints.positions = (0.6, 2.9)
        driver.read(1_000_000 * k)
    assert "outside its position_range [-2.8, 2.8]" in driver.faults()[0].text


def test_a_joints_limit_shrinks_the_whole_force(monkeypatch: pytest.MonkeyPatch) -> None:
    more = "buses.hand.options.joints.shoulder.effort_limit=1.0"
    driver, joints = made(monkeypatch, PLANAR, "hand", more)
    sent = []
    for force in (1.0, 50.0):
        joints.positions = (0.6, 1.2)
        driver.read(1_000_000 * len(sent))
        driver.write([AxisCommand(force, 0.0), AxisCommand(0.5 * force, 0.0)])
        sent.append([command.effort for command in joints.written[-1]])
    assert max(abs(effort) for effort in sent[1]) == pytest.approx(1.0)
    assert sent[1][0] / sent[1][1] == pytest.approx(sent[0][0] / sent[0][1])


def test_shipped_rigs_move_and_their_books_close() -> None:
    for path, seconds in ((PLANAR, 0.04), (SPATIAL, 0.01)):
        found = simulate(load_rig(path), duration_s=seconds)
        assert found.error is None
        for bus in ("hand", "arm"):
            books = found[f"arm.{bus}.work"] - found[f"arm.{bus}.kinetic"]
            assert np.ptp(books - found[f"arm.{bus}.potential"]) < 1e-11
            assert found[f"tip.{bus}.mapped_given"][-1] < 1e-5


DISC = "buses.hand.options.walls.disc"
OWN, TRUE = "buses.hand.options.chain", "buses.hand.options.truth.chain"
WRONG = (
    ("master.axes.x.id=7", "an axis of an arm is 1, 2, 3 (x, y, z of its tip)"),
    ("master.axes.x.id=4", "coordinate rx of an arm is rotary, got linear"),
    ("buses.hand.options.home=[0.0]", "home needs a position for each joint"),
    ("buses.hand.options.home=[0.0, 3.0]", "joint elbow: home is not in its position_range"),
    ("buses.hand.options.chain.dh=[{a: 0.1}]", "the chain has 1 joints"),
    (
        f"{OWN}.dh=[{{a: 0.1}}, {{inertia: [1, 1, -1, 0, 0, 0]}}]",
        "chain.dh.1.inertia: not physically possible",
    ),
    (f"{TRUE}={{dh: [{{a: 0.1}}]}}", "the truth.chain has 1 joints, `joints` names 2"),
    (f"{TRUE}={{urdf: nowhere.urdf}}", "nowhere.urdf: no such file"),
    (
        f"{TRUE}={{dh: [{{}}, {{inertia: [1, 1, -1, 0, 0, 0]}}]}}",
        "truth.chain.dh.1.inertia: not physically possible",
    ),
    (
        f"{TRUE}={{dh: [{{}}, {{kind: prismatic}}]}}",
        "joint elbow: in truth.chain it slides, in chain it turns",
    ),
    ("buses.hand.options.truth.joints.knee={}", "truth names no joint of the arm: knee"),
    ("buses.hand.options.walls.disc.size=[1, 1, 1]", "size does not apply to cylinder"),
    (
        "buses.hand.options.walls.disc={shape: mesh, stiffness: 1}",
        "mesh needs points and triangles",
    ),
    ("slave.axes.y.bus=hand", "is taken by master.axes.y"),
    ("buses.hand.options.joints.elbow.id=1", "joints shoulder and elbow have the same id"),
    ("buses.hand.options.bus.driver=arm", "on a bus of their own driver"),
    ("buses.hand.options.bus.driver=none", "bus.driver: unknown driver 'none'"),
    ("buses.hand.options.bus.options={speed: 1}", "bus.options.speed: Extra inputs"),
    (f"{DISC}={{shape: convex, planes: [], stiffness: 1}}", "convex needs at least a plane"),
    (
        f"{DISC}={{shape: path, points: [[0, 0, 0]], stiffness: 1}}",
        "path needs at least two points",
    ),
    (
        f"{DISC}={{shape: path, points: [[0, 0, 0], [0, 0, 0]], stiffness: 1}}",
        "two consecutive points of a path are identical",
    ),
    (
        f"{DISC}={{shape: mesh, points: [[0, 0, 0], [1, 1, 1], [2, 2, 2]], "
        "triangles: [[0, 1, 2]], stiffness: 1}",
        "triangle 0 has no area",
    ),
)


@pytest.mark.parametrize(("more", "said"), WRONG)
def test_wrong_keys_are_refused(more: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(PLANAR, [more])
    assert said in str(caught.value.problems)


POLICY = "simulation.hand.x.reference={type: policy, velocity_limit: 1, effort_limit: 1}"
SPARE = (
    ("simulation.environment.x={type: foam, stiffness: 1, position: 0}", "free, spring or wall"),
    ("simulation.axes.master.x.inertia=0.5", "in buses.hand.options.truth, and remove this"),
    ("simulation.integrator={scheme: exact}", "a simulated arm has its own"),
    (f"{POLICY};operate={{}}", "led by a hand with a reference"),
    ("simulation.axes.slave.x.load.constant=1.0", "slave.x.load: a simulated tip is moved"),
)


@pytest.mark.parametrize(("more", "said"), SPARE)
def test_what_a_simulated_tip_would_leave_out_is_refused(more: str, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        simulate(load_rig(PLANAR, more.split(";")), duration_s=0.01)


def test_home_has_a_place_along_the_frames_axes() -> None:
    options = options_of(PLANAR, "hand")
    plain = at_home(options.believed(), (1, 0, 0, 0, 1, 0, 0, 0, 1), options.at_home)
    x, y, _ = home_place(plain)
    assert (x, y) == pytest.approx(
        (
            0.18 * math.cos(0.6) + 0.16 * math.cos(1.8),
            0.18 * math.sin(0.6) + 0.16 * math.sin(1.8),
        )
    )
    turned = at_home(options.believed(), (0, 1, 0, -1, 0, 0, 0, 0, 1), options.at_home)
    assert home_place(turned)[:2] == pytest.approx((y, -x))


def test_of_a_skew_frame_every_axis_counts() -> None:
    """A chain bent out of the plane, and axes none of which is one of the base's."""
    options = options_of(SPATIAL, "arm")
    frame = np.array([[2.0, 3.0, 6.0], [3.0, -6.0, 2.0], [6.0, 2.0, -3.0]]) / 7.0
    task = at_home(options.believed(), tuple(frame.ravel()), np.array(options.at_home) + 0.4)
    home = np.array(task.home[:3])
    assert abs(home).min() > 0.01
    assert home_place(task) == pytest.approx(frame @ home, rel=1e-12)


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_compiled_controller_leads_an_arm_to_the_same_bits() -> None:
    pytest.importorskip("numba")
    python = simulate(load_rig(PLANAR), duration_s=0.4)
    compiled = simulate(load_rig(PLANAR, ["loop.engine=compiled"]), duration_s=0.4)
    assert np.array_equal(python.data, compiled.data)
    assert certify(load_rig(PLANAR)).passed


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(300)
def test_random_motions_through_singular_poses_stay_below_what_was_claimed() -> None:
    """`python -m tests.arms.motions --count 1000` has more of them."""
    motions = [move(seed) for seed in (0, 3)]
    assert all(motion.given < 0.05 * motion.claimed for motion in motions)
    assert min(motion.singular for motion in motions) < 0.01
    assert max(motion.engagements for motion in motions) > 1


@pytest.mark.parametrize(
    ("mapped", "beside", "shrunk"),
    [
        ([1.25, 0.5], [-0.25, 0.0], 1.0),  # what acts beside it makes room
        ([1.5, 0.5], [-0.25, 0.0], 1.25 / 1.5),
        ([-1.0, 0.5], [0.5, 0.0], 1.0),
        ([1.0, 0.5], [0.5, 0.0], 0.5),
        ([0.5, 0.0], [1.5, 0.0], 0.0),  # none is left
        ([0.0, 0.5], [1.5, 0.0], 1.0),
    ],
)
def test_mapped_efforts_shrink_together_and_no_more_than_they_must(
    mapped: list[float], beside: list[float], shrunk: float
) -> None:
    arm: Any = SimpleNamespace(_joints=[SimpleNamespace(effort_limit=1.0)] * 2)
    given = list(mapped)
    sent = ArmDriver._within(arm, mapped, beside)
    assert mapped == pytest.approx([shrunk * effort for effort in given])
    wanted = (shrunk * effort + other for effort, other in zip(given, beside, strict=True))
    assert sent == pytest.approx([min(max(effort, -1.0), 1.0) for effort in wanted])
