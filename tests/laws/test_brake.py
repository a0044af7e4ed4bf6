"""A motor as a brake: passive by the device's damping, tight, and within its joules with steps."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.analysis.walls.limits import greatest_damping
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.laws.rest.brake import (
    SHARE,
    BrakeParams,
    brake_effort,
    brake_velocity,
    device_takes,
    drag_anchor,
    passive_stiffness,
    step_power,
)

T, DEVICE, FILTER_S = 1e-3, 0.03, 0.02


def brake(delay: float, quantum: float = 0.0, step: float = 0.0, slip: float = 0.01) -> BrakeParams:
    damping = greatest_damping(SampledWall(0.0, 0.0, T, delay, FILTER_S), SHARE * DEVICE)
    stiffness = passive_stiffness(DEVICE, T, delay)
    power = step_power(DEVICE, T, quantum, step)
    return BrakeParams(
        stiffness, damping, T / (T + FILTER_S), slip, T, DEVICE, quantum, 0.0, power, 0.0
    )


class Given:
    """What a brake takes of a device that is led through samples `delay` periods later [J].

    `surely`: what the device loses for certain; `shown`: what its encoder shows of that.
    """

    def __init__(self, p: BrakeParams, delay: float, step: float = 0.0) -> None:
        whole = math.floor(delay)
        self._p, self._late, self._step = p, delay - whole, step
        self._way = deque([0.0] * (whole + 2), maxlen=whole + 2)
        self._anchor = self._velocity = self._at = 0.0
        self.work = self.surely = self.shown = 0.0

    def move(self, displacement: float, early: float | None = None) -> None:
        """One period: what was sent acts, the device moves, and a sample answers.

        `early`: the share of the displacement while the older command acts; default: evenly.
        """
        p, late = self._p, self._late
        share = late if early is None or late == 0.0 else early
        first, second = share * displacement, (1.0 - share) * displacement
        self.work += self._way[0] * first + self._way[1] * second
        loss = second * second / (1.0 - late) + (first * first / late if late > 0.0 else 0.0)
        self.surely += p.device * loss / p.period
        self.shown += device_takes(p, displacement, 1)
        self._at += displacement
        self._velocity = brake_velocity(p, self._velocity, displacement, 1)
        self._anchor = drag_anchor(p, self._anchor, self._at)
        effort = brake_effort(p, self._anchor, self._velocity, self._at)
        if self._step > 0.0:
            effort = math.trunc(effort / self._step) * self._step
        self._way.append(effort)


DELAYS = (0.0, 0.25, 0.5, 1.0, 2.3)
MOTION = st.lists(st.tuples(st.floats(-0.02, 0.02), st.floats(-0.5, 1.5)), min_size=1, max_size=80)


@pytest.mark.parametrize("delay", DELAYS)
@given(MOTION)
def test_no_motion_gets_more_than_two_thirds_of_what_the_device_takes(
    delay: float, motion: list[tuple[float, float]]
) -> None:
    led = Given(brake(delay), delay)
    for displacement, early in motion:
        led.move(displacement, early)
        assert led.work + 2.0 * SHARE * led.surely >= -1e-12


@pytest.mark.parametrize("delay", DELAYS)
@given(MOTION)
def test_the_slipping_spring_alone_takes_a_third(
    delay: float, motion: list[tuple[float, float]]
) -> None:
    led = Given(brake(delay)._replace(damping=0.0), delay)
    for displacement, early in motion:
        led.move(displacement, early)
        assert led.work + SHARE * led.surely >= -1e-12


def most_gained(p: BrakeParams, delay: float) -> float:
    """Return what whole swings get at most, over what the device takes meanwhile."""
    late, mean = delay - math.floor(delay), 0.5 + delay
    tuned = late + math.sqrt(mean * mean + late * (1.0 - late)) - mean
    shares = []
    for angle in (0.02, 0.1, math.pi):
        led = Given(p, delay)
        swings = 4 * round(2.0 * math.pi / angle)
        for before, after in pairwise([1e-4 * math.cos(angle * k) for k in range(swings + 1)]):
            led.move(after - before, tuned)
        shares.append(-led.work / led.surely)
    return max(shares)


@pytest.mark.parametrize("delay", DELAYS)
def test_a_tuned_motion_gets_what_the_spring_may_give(delay: float) -> None:
    """The bound is not empty: slow or fast, within the stretch."""
    p = brake(delay)._replace(damping=0.0)
    assert most_gained(p, delay) == pytest.approx(SHARE, rel=0.02)
    stiff = p._replace(stiffness=1.05 / SHARE * p.stiffness)  # beyond what the device bears
    assert most_gained(stiff, delay) > 1.0


@pytest.mark.parametrize("delay", DELAYS)
def test_the_spring_s_share_is_that_of_a_wall(delay: float) -> None:
    wall = SampledWall(passive_stiffness(DEVICE, T, delay), 0.0, T, delay)
    assert wall_leak(wall).damping == pytest.approx(SHARE * DEVICE, rel=1e-9)


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60), st.floats(0.05, 0.5))
def test_the_stretch_is_bounded_and_changes_by_no_more_than_the_device_moves(
    places: list[float], slip: float
) -> None:
    p = brake(0.0, slip=slip)
    anchor = at = 0.0
    for place in places:
        before = at - anchor
        moved = place - at
        at = place
        anchor = drag_anchor(p, anchor, at)
        stretch = at - anchor
        assert abs(stretch) <= slip + 1e-12
        assert abs(stretch - before) <= abs(moved) + 1e-12
        assert abs(stretch) <= abs(before + moved) + 1e-12


def test_it_slips_as_dry_friction_and_stays_where_it_is_left() -> None:
    p = brake(0.0)
    led = Given(p, 0.0)
    for displacement in [1e-4] * 1000:
        led.move(displacement)
    effort = p.stiffness * p.slip
    assert led.work == pytest.approx((effort + 0.1 * p.damping) * 0.1, rel=0.06)
    anchor = drag_anchor(p, 0.0, 0.1)
    assert brake_effort(p, anchor, 0.0, 0.1) == pytest.approx(effort)
    assert drag_anchor(p, anchor, anchor) == anchor == pytest.approx(0.09)


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("step", [0.0, 0.004])
@given(st.lists(st.integers(-6, 6), min_size=1, max_size=80))
def test_steps_of_encoder_and_drive_get_no_more_than_the_power(
    delay: float, step: float, motion: list[int]
) -> None:
    quantum = 1e-4
    p = brake(delay, quantum, step)
    led = Given(p, delay, step)
    for k, steps in enumerate(motion, 1):
        led.move(quantum * steps)
        assert led.work + led.shown + p.power * T * k >= -1e-12


def test_a_shiver_of_one_step_gets_a_fair_share_of_that_power() -> None:
    quantum = 1e-4
    p = brake(0.0, quantum)
    led = Given(p, 0.0)
    for k in range(400):
        led.move(quantum if k % 2 == 0 else -quantum)
    assert 0.1 * p.power * T * 400 < -led.work < p.power * T * 400


def test_the_power_is_the_closed_form_of_its_two_steps() -> None:
    assert step_power(DEVICE, T, 1e-4, 0.0) == pytest.approx(2.0 * DEVICE * (1e-4 / T) ** 2)
    assert step_power(DEVICE, T, 0.0, 0.004) == pytest.approx(0.75 * 0.004**2 / DEVICE)


def test_what_a_device_takes_is_never_more_than_it_loses() -> None:
    p = brake(0.0, 1e-4)
    rng = np.random.default_rng(5)
    for _ in range(500):
        start, speed, count = rng.uniform(0, 1e-4), rng.normal(0, 0.5), int(rng.integers(1, 5))
        shown = 1e-4 * (math.floor((start + speed * count * T) / 1e-4) - math.floor(start / 1e-4))
        assert device_takes(p, shown, count) <= DEVICE * speed**2 * count * T + 1e-15
