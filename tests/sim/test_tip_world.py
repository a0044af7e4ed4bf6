"""What acts on the tip of a simulated arm, and what a joint of it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.models.plant_params import PlantParams
from tautwave.registry import load_driver
from tautwave.truth import AxisModel
from tautwave_sim.arm import TipWorld
from tautwave_sim.loaded import JointPhysics
from tests.sim.truths import truth

PLANAR = Path(__file__).parents[2] / "configs" / "arms" / "planar.yaml"
TOUCHED = PlantParams(0.5, 0.0, 0.0, 200.0, 3.0, 40.0, 0.1, 900.0, 5.0, 0.2, 1.0)
"""Grip 200 N/m and 3 N s/m; a spring of 40 N/m at 0.1; a wall of 900 N/m and 5 N s/m from 0.2."""


def tip(model: AxisModel) -> TipWorld:
    options = load_driver("arm").options.model_validate(load_rig(PLANAR).buses["arm"].options)
    return TipWorld(options.task(), [0], [model])


def test_a_hand_leads_a_coordinate_along_its_path_and_stays_at_its_end() -> None:
    led = truth(reference=(0.0, 0.1, 0.3))
    world = tip(led)
    period = led.period
    assert world.reference(led, 0.0) == pytest.approx((0.0, 0.1 / period))
    assert world.reference(led, 1.25 * period) == pytest.approx((0.15, 0.2 / period))
    for late in (2.0, 2.5, 9.0):
        assert world.reference(led, late * period) == (0.3, 0.0)
    assert world.reference(led._replace(reference=()), period) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("x", "v", "touched", "stored"),
    [
        (0.15, 0.5, -40.0 * 0.05, 0.5 * 40.0 * 0.05**2),
        (0.25, 0.5, -40.0 * 0.15 - 900.0 * 0.05 - 2.5, 20.0 * 0.15**2 + 450.0 * 0.05**2),
        (0.25, -20.0, -40.0 * 0.15, 20.0 * 0.15**2 + 450.0 * 0.05**2),  # the wall never pulls
    ],
)
def test_a_joint_shows_what_holds_and_touches_it(
    x: float, v: float, touched: float, stored: float
) -> None:
    joint = JointPhysics(TOUCHED, x)
    joint.v, joint.given = v, 0.7
    hand, outside = joint.forces(0.4, 1.0)
    assert hand == pytest.approx(200.0 * (0.4 - x) + 3.0 * (1.0 - v))
    assert outside == pytest.approx(touched)
    assert joint.stored(0.4) == pytest.approx((0.7, 100.0 * (0.4 - x) ** 2, stored))


def test_the_tip_is_held_and_touched_as_an_axis_is() -> None:
    model = truth(reference=(0.4, 0.4))._replace(plant=TOUCHED)
    for held in (True, False):
        world = tip(model if held else model._replace(reference=()))
        world.show([0.3, 0.2], [0.0, 0.0])
        at = world.place[0]
        assert world.hand[0] == pytest.approx(200.0 * (0.4 - at) if held else 0.0)
        wall = 900.0 * max(at - 0.2, 0.0)
        assert world.outside[0] == pytest.approx(-40.0 * (at - 0.1) - wall)
        assert any(world.efforts_at([0.3, 0.2], [0.0, 0.0]))
