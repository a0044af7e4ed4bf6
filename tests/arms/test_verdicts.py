"""What an arm has for the axes of its tip: certified, refused, and slopes in closed form."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave.certificate.belief import declared_delays
from tautwave.certificate.buses import bus_elements
from tautwave.config import load_rig
from tautwave_drivers.arm.verdict import _bent
from tests.arms.test_tip import PLANAR, options_of, place_of


def elements(path: Path, *more: str) -> dict[str, Any]:
    rig = load_rig(path, list(more))
    return {element.name: element for element in bus_elements(rig, declared_delays(rig))}


def test_an_arm_is_certified_with_what_its_joints_have() -> None:
    found = elements(PLANAR)
    assert all(element.passive.passed for element in found.values())
    assert found["tip of hand"].passive.conditions
    # 800 N/m, 1 kHz, each joint's noise and its encoder step's a q^2 / 12
    step = 1.0e-5**2 + 2.4e-5**2 / 12.0
    watts = 800.0 * (0.34**2 + 0.16**2) * step * 1000.0
    assert found["wall disc of hand"].numbers["noise_w"] == pytest.approx(watts, rel=0.01)
    # Stretched out the tip is 0.34 m from the shoulder, and always 0.16 m from the elbow: 8 N.
    most = 8.0 * (0.34 + 0.16) * 20.0 / 1000.0
    assert most <= found["wall disc of hand"].numbers["stalled_j"] < 1.25 * most
    assert found["joint elbow of arm"].numbers["needed_damping"] > 0.0


def test_a_weight_that_is_carried_asks_more_of_every_joint() -> None:
    """What is taken off it depends on where the arm is, and is late like everything else."""
    free, carrying = (
        elements(PLANAR, f"buses.hand.options.carry={carry}") for carry in ("false", "true")
    )
    for joint in ("joint shoulder of hand", "joint elbow of hand"):
        needed = [found[joint].numbers["needed_damping"] for found in (free, carrying)]
        assert needed[1] > 1.02 * needed[0], joint


@pytest.mark.parametrize("q", [(0.6, 1.2), (-0.3, 0.9), (2.0, -2.2)])
def test_slopes_of_joint_efforts_are_second_derivatives(q: tuple[float, float]) -> None:
    """Of a tip at l1 (cos a, sin a) + l2 (cos (a + b), sin (a + b)), whatever the force's signs."""
    task = options_of(PLANAR, "hand").task()
    force = np.array([8.0, 5.0, 0.0, 0.0, 0.0, 0.0])
    fore = np.array([0.16 * math.cos(sum(q)), 0.16 * math.sin(sum(q))])
    tip = fore + np.array([0.18 * math.cos(q[0]), 0.18 * math.sin(q[0])])
    want = [force[:2] @ (np.abs(tip) + np.abs(fore)), force[:2] @ (2.0 * np.abs(fore))]
    slope = _bent(task, q, place_of(task, q)[1], force)
    assert slope == pytest.approx(want, abs=4e-4)  # a step of 1e-4, and the third ones at most


@pytest.mark.parametrize(
    ("more", "name", "said"),
    [
        ("buses.hand.options.joints.elbow.damping_lower=1e-4", "joint elbow of hand", "raise rate"),
        (
            "buses.hand.options.joints.elbow.effort_limit=0.5",
            "joint elbow of hand",
            "lower the eff",
        ),
        (
            "buses.hand.options.joints.elbow.inertia_lower=1e-5",
            "tip of hand",
            "lower inertia.lower",
        ),
        ("master.axes.x.damping=2.0", "tip of hand", "lower damping.lower to"),
    ],
)
def test_what_an_arm_does_not_have_is_refused(more: str, name: str, said: str) -> None:
    element = elements(PLANAR, more)[name]
    assert not element.passive.passed
    assert said in element.passive.reason
