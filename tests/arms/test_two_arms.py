"""Two arms that weigh, simulated as what they are and coupled joint by joint: the shipped rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave import simulate
from tautwave.config import load_rig
from tautwave.errors import ConfigError

SHIPPED = Path(__file__).parents[2] / "configs" / "arms-loopback.yaml"


def rows(seconds: float, more: list[str]) -> tuple[Any, dict[str, Any]]:
    rig = load_rig(SHIPPED, more)
    found = simulate(rig, duration_s=seconds)
    assert found.error is None
    return rig, dict(zip(found.columns, found.data.T, strict=True))


def imbalance(table: dict[str, Any], side: str) -> float:
    books = (
        table[f"arm.{side}.work"] - table[f"arm.{side}.kinetic"] - table[f"arm.{side}.potential"]
    )
    return float(np.ptp(books))


def test_both_arms_keep_their_energy_and_hold_their_weight() -> None:
    rig, table = rows(0.08, [])
    for side in ("master", "slave"):
        assert imbalance(table, side) < 1e-12
        flow = sum(
            np.abs(np.diff(table[f"load.{side}.{name}.energy"])).sum() for name in rig.master.axes
        )
        assert table[f"load.{side}.given"][-1] < 1e-3 * flow
    heavy = table["load.slave.shoulder.effort"]
    assert heavy[40:].min() > 3.0  # N m: stretched out it weighs


def test_without_its_weight_carried_the_follower_hangs_lower() -> None:
    _, carried = rows(0.08, [])
    _, hanging = rows(0.08, ["slave.arm.compensate=false"])
    assert "load.slave.leak" not in hanging
    sagged = hanging["true.slave.shoulder.position"] - carried["true.slave.shoulder.position"]
    assert sagged[-1] < -2e-3


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(600)
def test_every_joint_follows_within_15_mrad_of_the_delayed_leader() -> None:
    rig, table = rows(9.0, [])
    late = rig.delay_samples
    for name in rig.master.axes:
        leader = table[f"true.master.{name}.position"]
        follower = table[f"true.slave.{name}.position"]
        error = (leader - leader[0])[:-late] - (follower - follower[0])[late:]
        assert np.sqrt(np.mean(error**2)) < 15e-3
    for side in ("master", "slave"):
        assert imbalance(table, side) < 1e-11
        assert table[f"load.{side}.given"][-1] < 1e-4
        height = table[f"arm.{side}.potential"]
        assert np.abs(table[f"load.{side}.potential"] - height + height[0]).max() < 2e-3


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(600)
def test_nothing_drifts_while_the_hand_rests() -> None:
    still = [
        f"simulation.hand.{name}.reference={{type: hold, position: 0.0}}"
        for name in ("waist", "shoulder", "elbow", "forearm", "wrist", "flange")
    ]
    rig, table = rows(6.0, still)
    for side in ("master", "slave"):
        for name in rig.master.axes:
            position = table[f"true.{side}.{name}.position"]
            assert abs(position[-1] - position[3000]) < 3e-4  # rad in 3 s


ARMS = "simulation.arms.slave={dh: [{mass: 1.0}]}"
REFUSED = (
    (ARMS, "1 joints (row 1) for 6 axes"),
    ("simulation.integrator={scheme: exact}", "an arm has its own; remove it"),
    (
        "simulation.environment.wrist={type: foam, stiffness: 1.0, position: 0.0}",
        "the joints of an arm support free, spring or wall environments only",
    ),
    ("simulation.axes.slave.wrist.load.constant=1.0", "the chain of the slave's arm already"),
)


@pytest.mark.parametrize(("override", "said"), REFUSED)
def test_what_the_simulation_of_an_arm_cannot_do_is_refused(override: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_rig(SHIPPED, [override])
    assert any(said in problem for problem in caught.value.problems)


def test_an_arm_on_a_slow_bus_is_refused() -> None:
    with pytest.raises(ConfigError, match="an arm is served in every cycle; remove it"):
        load_rig(SHIPPED, ["buses.arm.divisor=2"])
