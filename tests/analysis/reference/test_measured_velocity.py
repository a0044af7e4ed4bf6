"""A wall's damper on a measured velocity: what it needs of a device, and hands that show it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.walls.limits import greatest_damping as of_differences
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tests.analysis.reference.measured_velocity import (
    Velocimeter,
    greatest_damping,
    needed_at,
    radius,
)

DEVICE = 0.02
LOOP_S = 5e-5


def behind(hertz: float) -> float:
    return 1.0 / (math.tau * hertz)


@pytest.mark.parametrize(("stiffness", "delay"), [(10.0, 0), (10.0, 1), (300.0, 2)])
def test_without_a_damper_it_is_colgate_and_schenkels(stiffness: float, delay: int) -> None:
    found = needed_at(Velocimeter(behind(500.0)), stiffness, 0.0, 1e-3, delay).max()
    wanted = wall_leak(SampledWall(stiffness, 0.0, 1e-3, delay)).damping
    assert found == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("filter_s", [0.0, 1e-3])
def test_with_a_loop_as_slow_as_the_hosts_it_is_a_wall_on_differences(filter_s: float) -> None:
    meter = Velocimeter(filter_s, loop_s=1e-3, late=0)
    found = needed_at(meter, 20.0, 0.03, 1e-3, 1).max()
    wanted = wall_leak(SampledWall(20.0, 0.03, 1e-3, 1, filter_s)).damping
    assert found == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("period", [1e-3, 2.5e-3])
@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("hertz", [10.0, 30.0, 100.0, 500.0])
def test_of_differences_behind_the_same_filter_more_is_certified(
    period: float, delay: int, hertz: float
) -> None:
    measured = greatest_damping(Velocimeter(behind(hertz)), DEVICE, period, delay)
    differences = of_differences(SampledWall(0.0, 0.0, period, delay, behind(hertz)), DEVICE)
    assert measured < differences


@pytest.mark.slow
@pytest.mark.parametrize(
    ("period", "hertz", "delay"), [(2.5e-3, 500.0, 1), (1e-3, 100.0, 1), (2.5e-3, 100.0, 1)]
)
def test_no_hand_is_unstable_below_what_is_certified_and_some_are_with_what_differences_allow(
    period: float, hertz: float, delay: int
) -> None:
    """The hands are a mass on a spring, many with its frequency folded by the host's rate."""
    meter = Velocimeter(behind(hertz))
    bound = greatest_damping(meter, DEVICE, period, delay)
    differences = of_differences(SampledWall(0.0, 0.0, period, delay, behind(hertz)), DEVICE)
    draws = np.random.default_rng(5)
    least, at = math.inf, (3.0, 0.0)
    for number in range(500):
        if number < 250 or math.isinf(least):
            at_log = draws.uniform(1.5, 4.6), draws.uniform(-4.0, 1.0)
        else:
            at_log = at[0] + 0.02 * draws.normal(), at[1] + 0.1 * draws.normal()
        omega, mass = 10.0 ** at_log[0], 10.0 ** at_log[1]
        user = mass, DEVICE, mass * omega * omega

        def unstable(damping: float, user: tuple[float, float, float] = user) -> bool:
            return radius(meter, (0.0, damping), period, delay, user) > 1.0 + 1e-11

        low, high = 0.0, min(least, 20.0 * bound)
        if not unstable(high):
            continue
        for _ in range(14):
            middle = 0.5 * (low + high)
            low, high = (low, middle) if unstable(middle) else (middle, high)
        least, at = high, at_log
    assert bound <= least < differences
    mass = 10.0 ** at[1]
    hand = mass, DEVICE, mass * 10.0 ** (2.0 * at[0])
    assert radius(None, (0.0, differences), period, delay, hand, behind(hertz)) <= 1.0 + 1e-11
