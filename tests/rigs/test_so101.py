"""Two SO-101 on simulated Feetech servos: what they weigh is carried, the follower follows."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave import load_rig, simulate
from tautwave.errors import ConfigError
from tests.rigs.running import Run, run_rig

CONFIGS = Path(__file__).parents[2] / "configs"
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
FREE = tuple(name for name in JOINTS if name != "elbow_flex")
WALL = 0.15


def apart(run: Run, joint: str) -> float:
    """Return how far the ends of a pair were apart, rms [rad]."""
    master, slave = (run[f"true.{side}.{joint}.position"] for side in ("master", "slave"))
    return float(np.sqrt(np.mean((master - slave) ** 2)))


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize(("name", "worst"), [("so101-pair-sim", 0.04), ("so101-hls-sim", 0.02)])
def test_the_follower_follows_and_meets_its_wall(name: str, worst: float) -> None:
    run = run_rig(load_rig(CONFIGS / f"{name}.yaml"), duration_s=6.0)
    assert max(apart(run, joint) for joint in FREE) < worst
    elbow = run["true.slave.elbow_flex.position"]
    assert WALL < elbow.max() < WALL + 0.06
    assert run["true.master.elbow_flex.position"].max() > elbow.max() + 0.05
    felt = run["true.master.elbow_flex.hand_effort"][
        run["true.master.elbow_flex.position"].argmax()
    ]
    assert felt > 0.1


@pytest.mark.slow
def test_the_leader_carries_its_weight() -> None:
    """Let go of, it stays; the same arm whose weight nobody carries falls."""
    still = {
        f"simulation.hand.{name}.reference={{type: minimum_jerk, waypoints: [[0.5, 0.0]]}}"
        for name in JOINTS
    }
    where = []
    for carried in ("true", "false"):
        rig = load_rig(
            CONFIGS / "so101-pair-sim.yaml", [*sorted(still), f"master.arm.compensate={carried}"]
        )
        run = run_rig(rig, duration_s=1.5)
        where.append(float(np.abs(run["true.master.shoulder_lift.position"]).max()))
    carried, fallen = where
    assert carried < 0.02
    assert fallen > 3.0 * carried


@pytest.mark.slow
def test_the_play_is_in_what_the_leaders_encoders_see() -> None:
    run = run_rig(load_rig(CONFIGS / "so101-pair-sim.yaml"), duration_s=0.5)
    seen, true = (run[f"{what}master.wrist_roll.position"] for what in ("", "true."))
    assert np.abs(seen - true).max() > 0.5 * 2.0 * math.pi / 4096 + 1e-4


@pytest.mark.slow
def test_it_is_simulated_without_a_word_on_watchdogs() -> None:
    """No device outlives the process of a simulation."""
    rows = simulate(load_rig(CONFIGS / "so101-hls-sim.yaml"), duration_s=0.05)
    assert rows.error is None
    assert len(rows["time_s"]) == 10


def test_a_simulated_arm_on_a_bus_that_moves_none_is_refused() -> None:
    changes = ["buses.leader.driver=dynamixel", "buses.leader.options={port: sim, servos: []}"]
    with pytest.raises(ConfigError, match="on one bus, of loopback or feetech"):
        load_rig(CONFIGS / "so101-pair-sim.yaml", changes)
