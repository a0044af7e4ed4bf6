"""A rig stepped by a program: what `simulate` does, with the physics handed over."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tautwave import ConfigError, Rig, SafetyStop, Stepper, load_rig, simulate
from tautwave.rig.truth import axis_model
from tautwave_sim.axis import make_physics

CONFIGS = Path(__file__).parents[2] / "configs"
BOOKS = ("kinetic", "stored", "loss", "environment_effort", "hand_work")
"""Of the plant: what a world outside does not tell."""


@pytest.mark.parametrize(
    ("name", "sides"),
    [
        ("bench-1dof-loopback", ("slave",)),
        ("bench-2axis-loopback", ("slave.slide", "master.wrist")),
        ("bench-dynamixel-sim", ("slave",)),  # commands by bytes, a period late
    ],
)
def test_the_same_physics_outside_gives_the_same_rows(name: str, sides: tuple[str, ...]) -> None:
    rig, duration_s = load_rig(CONFIGS / f"{name}.yaml"), 0.8  # the hand begins at 0.5
    inside = simulate(rig, duration_s=duration_s, engine="python")
    cycles = round(duration_s * rig.rate_hz)
    with Stepper(rig, outside=sides, duration_s=duration_s) as stepper:
        models = {axis: axis_model(rig, axis, cycles) for axis in stepper.outside}
        worlds = {axis: make_physics(model) for axis, model in models.items()}
        hands = {
            axis: [*(model.reference or [0.0]), *(model.reference or [0.0])[-1:]]
            for axis, model in models.items()
        }
        slot, efforts = 0, stepper.step({axis: world.x for axis, world in worlds.items()})
        while stepper.running:
            for axis, world in worlds.items():
                here, there = hands[axis][min(slot, len(hands[axis]) - 2) :][:2]
                rate = (there - here) / rig.period_s
                world.step(efforts[axis], here, rate, rig.period_s)
            slot += 1
            efforts = stepper.step(
                {axis: world.x for axis, world in worlds.items()},
                {axis: world.v for axis, world in worlds.items()},
            )
        rows = stepper.rows
    assert efforts == dict.fromkeys(stepper.outside, 0.0)
    assert len(rows) == len(inside) == cycles
    for axis in stepper.outside:
        assert inside[f"plant.{axis}.motor_work"][-1] != 0.0  # it did move
    for column in inside.columns:
        known = not column.endswith(BOOKS) or not column.split(".", 1)[1].startswith(sides)
        if column != "compute_us" and known and "hand_effort" not in column:
            assert np.array_equal(inside[column], rows[column], equal_nan=True), column


def jump_out(stepper: Stepper) -> None:
    while True:
        stepper.step({"slave.lever": 0.6})  # beyond its range


def test_a_limit_ends_it_with_its_reason() -> None:
    rig = load_rig(CONFIGS / "bench-1dof-loopback.yaml")
    with Stepper(rig, duration_s=1.0) as stepper:
        for _ in range(5):
            stepper.step({"slave.lever": 0.0})
        with pytest.raises(SafetyStop, match=r"slave\.lever"):
            jump_out(stepper)
        assert not stepper.running
        assert stepper.rows.error is not None
        with pytest.raises(ConfigError, match="has ended"):
            stepper.step({"slave.lever": 0.0})


def test_leaving_early_leaves_no_effort() -> None:
    rig = load_rig(CONFIGS / "bench-1dof-loopback.yaml")
    with Stepper(rig, duration_s=1.0) as stepper:
        for k in range(200):
            efforts = stepper.step({"slave.lever": 0.001 * math.sin(0.1 * k)})
        assert efforts["slave.lever"] != 0.0
    assert len(stepper.rows) == 200
    assert stepper._axes["slave.lever"].acting() == 0.0


@pytest.mark.parametrize(
    ("outside", "rig", "part"),
    [
        (["slave.knee"], "bench-1dof-loopback", "no axis of bench-1dof"),
        ([], "bench-1dof-loopback", "at least one"),
        (["slave"], "bench-admittance-loopback", "admittance"),
        (["slave"], "arms-loopback", "joints move together"),
        (["slave"], "bench-multirate-loopback", "every cycle"),
    ],
)
def test_what_cannot_be_outside_is_refused(outside: list[str], rig: str, part: str) -> None:
    with pytest.raises(ConfigError, match=part):
        Stepper(load_rig(CONFIGS / f"{rig}.yaml"), outside=outside)


def test_an_axis_with_a_damper_in_its_motor_is_not_outside() -> None:
    """What its motor does between two steps, no effort of a step has."""
    one, other = (
        f"{{id: {at}, feedback_id: {0x10 + at}, p_max: 12.5, v_max: 30.0, t_max: 10.0"
        for at in (1, 2)
    )
    damper = ", damping: 0.1, velocity_filter_hz: 500"

    def rig(more: str) -> Rig:
        motors = f"buses.can.options.motors=[{one}}}, {other}, direction: -1{more}}}]"
        return load_rig(CONFIGS / "bench-mit-virtual.yaml", [motors])

    for more in (damper, f"{damper}, damped: at_wall"):
        with pytest.raises(ConfigError, match="remove damping from the options of bus 'can'"):
            Stepper(rig(more), outside="slave")
    for more, outside in (("", "slave"), (damper, "master")):
        with Stepper(rig(more), outside=outside, duration_s=0.01) as stepper:
            while stepper.running:
                stepper.step(dict.fromkeys(stepper.outside, 0.0))


NONE = r"slave\.lever: one finite number of rad or m"


@pytest.mark.parametrize(
    ("given", "part"),
    [
        ({}, r"slave\.lever needs a position"),
        ({"slave.lever": math.nan}, NONE),
        ({"slave.lever": math.inf}, NONE),
        ({"slave.lever": None}, NONE),
        ({"slave.lever": np.zeros(2)}, NONE),
        ({"slave.lever": 0.0, "slave.levr": 0.0}, r"slave\.levr is not an outside axis"),
        ([0.0], "a mapping from axes"),
    ],
)
def test_a_position_has_to_be_one(given: Any, part: str) -> None:
    with Stepper(load_rig(CONFIGS / "bench-1dof-loopback.yaml"), duration_s=1.0) as stepper:
        with pytest.raises(ConfigError, match=part):
            stepper.step(given)
        assert stepper.running
        stepper.step({"slave.lever": np.zeros(1)}, {"slave.lever": np.ones((1, 1))})  # as MuJoCo's
        with pytest.raises(ConfigError, match=r"slave\.lever: one finite number of rad/s"):
            stepper.step({"slave.lever": 0.0}, {"slave.lever": math.nan})
    assert not stepper.running
    with pytest.raises(ConfigError, match="has ended"):
        stepper.step({"slave.lever": 0.0})


@pytest.mark.parametrize("length", [0.0, -1.0, math.nan, math.inf])
def test_a_length_or_a_clock_that_is_none_is_refused(length: float) -> None:
    rig = load_rig(CONFIGS / "bench-1dof-loopback.yaml")
    with pytest.raises(ConfigError, match="duration_s: a finite number"):
        Stepper(rig, duration_s=length)
    with pytest.raises(ConfigError, match="duration_s: a finite number"):
        simulate(rig, duration_s=length)
    with pytest.raises(ConfigError, match="clock: real or fake"):
        Stepper(rig, outside="slave", clock="wall")
