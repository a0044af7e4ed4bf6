"""From rows to joint states, wrenches and diagnostics."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("cyclonedds")

from tautwave.config import load_rig
from tautwave.runtime.operate.states import STATES
from tautwave.runtime.tap import Live
from tautwave.view.ros.diagnostics import ERROR, OK, STALE, WARN, ended, statuses
from tautwave.view.ros.messages import Time
from tautwave.view.ros.states import (
    joint_state,
    joints_of,
    stamp,
    tips_of,
    torque_of,
    whole,
    wrench,
)

CONFIGS = Path(__file__).parents[3] / "configs"
LEAVES = ("position", "velocity", "commanded", "valid")
NOW = Time(7, 8)


def columns(*stems: str) -> list[str]:
    return ["time_s", *(f"{stem}.{leaf}" for stem in stems for leaf in LEAVES)]


def numbered(names: list[str]) -> list[float]:
    """Return a row in which each column has its place as its value."""
    return [float(k) for k in range(len(names))]


def test_axes_of_a_bench_are_joints_by_their_names() -> None:
    rig = load_rig(CONFIGS / "bench-2axis-loopback.yaml")
    names = columns("master.wrist", "slave.wrist", "master.slide", "slave.slide")
    found = joints_of(names, rig)
    assert list(found) == ["master", "slave"]
    state = joint_state(found["slave"], row := numbered(names), NOW)
    at = {name: row[k] for k, name in enumerate(names)}
    assert state.name == ["wrist", "slide"]
    assert state.position == [at["slave.wrist.position"], at["slave.slide.position"]]
    assert state.velocity == [at["slave.wrist.velocity"], at["slave.slide.velocity"]]
    assert state.effort == [at["slave.wrist.commanded"], at["slave.slide.commanded"]]
    row[names.index("slave.slide.valid")] = 0.0
    assert not whole(row, found["slave"].valid)
    assert whole(row, found["master"].valid)
    assert tips_of(names, rig) == {}


def test_effort_of_an_axis_that_takes_velocity_is_what_its_sensor_measures() -> None:
    rig = load_rig(CONFIGS / "bench-admittance-loopback.yaml")
    side = next(name for name, axis in rig.axes.items() if axis.causality == "admittance")
    names = [*columns(*rig.axes), f"{side}.measured_effort"]
    found = joints_of(names, rig)[side.partition(".")[0]]
    state = joint_state(found, numbered(names), NOW)
    assert state.effort == [names.index(f"{side}.measured_effort")]


def test_one_site_of_two_shows_what_it_has() -> None:
    rig = load_rig(CONFIGS / "bench-1dof-loopback.yaml")
    assert list(joints_of(columns("slave.lever"), rig)) == ["slave"]


def test_an_arm_has_joints_and_a_wrench_of_coupling_and_walls() -> None:
    rig = load_rig(CONFIGS / "arms" / "planar.yaml")
    names = [
        *columns("master.x", "master.y"),
        "joints.master.shoulder.position", "joints.master.elbow.position",
        "joints.master.shoulder.effort", "joints.master.elbow.effort",
        *(f"space.hand.{wall}.f{axis}" for wall in ("disc", "rail") for axis in "xyz"),
    ]  # fmt: skip
    row = numbered(names)
    state = joint_state(joints_of(names, rig)["master"], row, NOW)
    assert state.name == ["shoulder", "elbow"]
    assert state.position == [names.index(f"joints.master.{j}.position") for j in state.name]
    assert state.effort == [names.index(f"joints.master.{j}.effort") for j in state.name]
    assert state.velocity == []  # nothing is measured of it
    tips = tips_of(names, rig)
    assert list(tips) == ["master"]
    message = wrench(tips["master"], row, NOW, "master_tip")
    assert message.header.frame_id == "master_tip"
    walls = [names.index(f"space.hand.{wall}.fx") for wall in ("disc", "rail")]
    assert message.wrench.force.x == names.index("master.x.commanded") + sum(walls)
    assert message.wrench.force.z == sum(walls) + 4
    assert message.wrench.torque.x == 0.0


def test_a_torque_is_known_where_the_whole_rotation_is() -> None:
    rig = load_rig(CONFIGS / "arms" / "six-seven.yaml")
    six = [f"slave.{name}" for name in ("x", "y", "z", "rx", "ry", "rz")]
    names = columns(*six)
    row = [0.0 if name.startswith("slave.r") and "position" in name else 2.0 for name in names]
    torque = wrench(tips_of(names, rig)["slave"], row, NOW, "").wrench.torque
    assert (torque.x, torque.y, torque.z) == (2.0, 2.0, 2.0)
    names = columns(*six[:5])
    torque = wrench(tips_of(names, rig)["slave"], numbered(names), NOW, "").wrench.torque
    assert math.isnan(torque.x)


def turned(r: Any) -> Any:
    """Rotation matrix of a rotation vector (Rodrigues)."""
    angle = float(np.linalg.norm(r))
    x, y, z = np.asarray(r) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1.0 - math.cos(angle)) * k @ k


@pytest.mark.parametrize("turn", [(0.3, -0.7, 1.1), (1e-5, 2e-5, -1e-5), (-2.0, 0.5, 1.0)])
def test_a_torque_does_the_power_of_the_coordinates(turn: tuple[float, float, float]) -> None:
    effort = np.array([0.4, -1.3, 0.9])
    torque = np.array(torque_of(turn, tuple(effort)))
    h = 1e-6
    for axis in range(3):
        step = h * np.eye(3)[axis]
        small = turned(np.array(turn) + step) @ turned(np.array(turn) - step).T
        omega = np.array([small[2, 1] - small[1, 2], small[0, 2] - small[2, 0],
                          small[1, 0] - small[0, 1]]) / (4.0 * h)  # fmt: skip
        assert torque @ omega == pytest.approx(effort[axis], abs=1e-4)


def test_a_stamp_is_wall_time() -> None:
    assert stamp(1.25, 1_700_000_000_900_000_000) == Time(1_700_000_002, 150_000_000)


BOOKS = [f"lever.line.{part}" for part in ("absorbed", "stored", "dissipated")]
NAMES = ["time_s", "lateness_us", "skipped_slots", "slave.lever.valid", "operation.state",
         "lever.position_error", *BOOKS]  # fmt: skip


def live(**facts: Any) -> Live:
    certificate = {"passed": True, "state": "passed", "require": "passive", "sentences": []}
    facts = {"rig": "bench", "units": {"lever": "rad"}, "certificate": certificate, **facts}
    return Live(0, 0, NAMES, 8, 1000.0, facts)


def seen(found: Any) -> dict[str, tuple[int, str]]:
    return {one.name.removeprefix("bench: "): (one.level, one.message) for one in found}


def test_diagnostics_of_a_second() -> None:
    engaged = float(STATES.index("engaged"))
    rows = [[0.0, 80.0, 0.0, 1.0, engaged, 0.1, 3.0, 1.0, 2.0],
            [0.1, 20.0, 3.0, 0.0, engaged, 0.2, 3.0, 1.0, 2.0]]  # fmt: skip
    found = statuses(live(), rows, 5, [], "held")
    assert seen(found) == {
        "certificate": (OK, "passed"),
        "run": (OK, "engaged"),
        "loop": (WARN, "3 slots skipped"),
        "lever": (OK, "tracking error 0.2"),
    }
    values = {pair.key: pair.value for one in found for pair in one.values}
    assert values["dead_man"] == "held"
    assert values["rows_not_seen"] == "5"
    assert values["lateness_max_us"] == "80"
    assert values["cycles_without_sample slave.lever"] == "1"
    assert values["line.dissipated_j"] == "2"
    assert {one.hardware_id for one in found} == {"bench"}


def test_diagnostics_of_what_is_wrong() -> None:
    refused = {"passed": False, "state": "refused", "require": "passive", "sentences": ["why"]}
    fault = (1, {"word": "fault", "state": "holding", "text": "slave.lever: no sample"})
    rows = [[0.0, 1.0, 0.0, 1.0, float(STATES.index("holding")), 0.0, 0.0, 0.0, 0.0]]
    depends = {"passed": True, "state": "conditional", "require": "passive", "sentences": ["if"]}
    (certificate, *_) = statuses(live(certificate=depends), rows, 0, [], "")
    assert (certificate.level, certificate.message) == (WARN, "conditional")
    assert [pair.value for pair in certificate.values] == ["passive", "if"]
    found = seen(statuses(live(certificate=refused), rows, 0, [fault], ""))
    assert found["certificate"] == (ERROR, "refused")
    assert found["run"] == (ERROR, "holding; fault: slave.lever: no sample")
    assert seen(statuses(live(certificate=None), [], 0, [], "")) == {
        "certificate": (WARN, "not evaluated"), "run": (STALE, "no new rows"),
    }  # fmt: skip
    over = (2, {"word": "fault", "state": "ended", "text": "bus died"})
    assert seen(ended(live(), [fault, over])) == {"run": (ERROR, "bus died")}
    assert seen(ended(live(), [])) == {"run": (STALE, "the run has ended")}
