"""What a damper in the motor does for a wall: no hand undoes it, and some come close to it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.walls.in_motor import (
    damper_needs,
    damping_for,
    least_damping,
    spent_on,
)
from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.types import Damper
from tests.analysis.motor_loop import radius

LOOP_S = 5e-5
QUICK, SLOW = 1.0 / (math.tau * 500.0), 1.0 / (math.tau * 100.0)


def damper(damping: float, filter_s: float, late: float = 1.0) -> Damper:
    return Damper(damping, filter_s, LOOP_S, late, 0.0)


def certified(one: Damper, device: float, period: float, delay: int) -> float:
    wall = SampledWall(1.0, 0.0, period, delay, 0.0)  # what it finds does not depend on K
    return greatest_stiffness(wall, damping_for(one, device, wall))


def least_unstable(
    one: Damper, device: float, period: float, delay: int, hands: int, seed: int
) -> float:
    """Return the least wall that some hand makes unstable, of many at random and near the worst."""
    draws = np.random.default_rng(seed)
    least, at = math.inf, (1.5, 0.0)
    for number in range(hands):
        if number < hands // 2 or math.isinf(least):
            at_log = draws.uniform(1.5, 4.6), draws.uniform(-3.0, 2.0)
        else:
            at_log = at[0] + 0.03 * draws.normal(), at[1] + 0.1 * draws.normal()
        omega, mass = 10.0 ** at_log[0], 10.0 ** at_log[1]

        def unstable(wall: float, omega: float = omega, mass: float = mass) -> bool:
            hand = mass * omega * omega
            return radius(one, wall, period, mass, device, hand, delay) > 1.0 + 1e-11

        low, high = 0.0, min(least, 4000.0)
        if not unstable(high):
            continue
        for _ in range(16):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if unstable(middle) else (middle, high)
        least, at = high, at_log
    return least


@pytest.mark.slow
@pytest.mark.parametrize(
    ("device", "one", "period", "delay", "close"),
    [
        (0.05, damper(0.1, QUICK), 1e-3, 1, 1.05),
        (0.05, damper(0.2, QUICK), 2.5e-3, 1, 1.05),
        (0.05, damper(0.1, SLOW), 2.5e-3, 1, 1.10),
        (0.02, damper(0.1, 1e-3, 0.0), 2.5e-3, 1, 1.6),
        (0.05, damper(0.1, QUICK), 2.5e-3, 0, 1.6),
    ],
)
def test_no_hand_is_unstable_below_what_is_certified_and_some_are_just_above(
    device: float, one: Damper, period: float, delay: int, close: float
) -> None:
    bound = certified(one, device, period, delay)
    found = least_unstable(one, device, period, delay, 400, 7)
    assert bound <= found <= close * bound
    bare = greatest_stiffness(SampledWall(1.0, 0.0, period, delay, 0.0), device)
    assert bound > 1.8 * bare


def test_for_slow_motion_it_is_a_damper_like_any_other() -> None:
    """A late spring is worst at low frequencies, where device and damper simply add up."""
    wall = SampledWall(1.0, 0.0, 2.5e-3, 2, 0.0)
    found = damping_for(damper(0.2, QUICK), 0.1, wall)
    assert found == pytest.approx(0.3, rel=2e-3)


def test_without_a_filter_and_at_the_motors_rate_it_is_colgate_and_schenkels() -> None:
    """With both laws in one loop of the same rate the sum of both is one wall, and its B adds."""
    one = Damper(0.02, 0.0, 1e-3, 0.0, 0.0)
    assert damper_needs(one) == pytest.approx(0.02)
    together = wall_leak(SampledWall(40.0, 0.02, 1e-3)).damping
    alone = SampledWall(40.0, 0.0, 1e-3)
    spent = spent_on(one, 0.06, alone)
    assert spent == pytest.approx(together, rel=2e-3)


def test_a_damper_that_the_device_cannot_bear_lends_nothing() -> None:
    one = damper(1.0, QUICK)
    needed = damper_needs(one)
    assert needed > 0.1
    wall = SampledWall(10.0, 0.0, 1e-3, 1, 0.0)
    assert damping_for(one, 0.1, wall) == least_damping(one, 0.1, 1e-3) == 0.1 - needed < 0.0
    assert math.isinf(spent_on(one, 0.1, wall))


def test_a_delay_within_a_period_counts_what_is_sure_at_every_frequency() -> None:
    one = damper(0.1, QUICK)
    wall = SampledWall(10.0, 0.0, 1e-3, 0.5, 0.0)
    assert damping_for(one, 0.05, wall) == 0.05 - damper_needs(one)


def test_what_is_spent_is_the_least_with_which_the_wall_passes() -> None:
    one = damper(0.1, QUICK)
    wall = SampledWall(60.0, 0.0, 1e-3, 1, 0.0)
    needed = wall_leak(wall).damping
    spent = spent_on(one, 0.05, wall)
    assert damper_needs(one) < spent < 0.05 < needed
    assert damping_for(one, spent * 1.001, wall) >= needed
    assert damping_for(one, spent * 0.99, wall) < needed
