"""Stable stiffness of a device at a wall, against tables and against the simulated map."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.sampled import SampledWall, split_delay, velocity_gain
from tautwave.analysis.walls.stability import (
    held_device,
    stable_stiffness,
    wall_matrix,
    wall_mode,
)
from tautwave.errors import ConfigError
from tautwave.laws.wall import WallParams, wall_effort
from tautwave.models.hand import PAPER_HAND
from tautwave.models.plant import PlantParams, plant_cache, plant_step
from tests.analysis.reference.wall_rules import linear_rule
from tests.examples import tried

T = 1e-3


def simulated_growth(wall: SampledWall, device: Device) -> float:
    """2 ln |z| of the simulator's own one-period map: columns are unit initial states.

    The plant's step and the live law, on increments, so that the map's distance from the
    identity keeps its digits.
    """
    plant = PlantParams(
        device.mass, device.damping, 0.0, device.stiffness, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    )
    law = WallParams(0.0, 1.0, wall.stiffness, wall.damping, controlled=False)
    # A wall never pulls: of a negative damper the other side is taken.
    sign = math.copysign(1.0, wall.damping)
    spring, damper = wall_effort(law, 1.0, 0.0), sign * wall_effort(law, 1e-300, sign)
    whole, rest = split_delay(wall.delay)
    spans = [rest * wall.period, (1.0 - rest) * wall.period] if rest else [wall.period]
    caches = [plant_cache(plant, span) for span in spans]
    gain = velocity_gain(wall)
    count = whole + (1 if rest else 0)
    # Units that make the numbers alike: x, v T, w T, u T^2 / m.
    units = np.array(
        [1.0, 1 / wall.period, 1 / wall.period, *[device.mass / wall.period**2] * count]
    )
    size = 3 + count
    change = np.zeros((size, size))
    for column in range(size):
        state = np.zeros(size)
        state[column] = units[column]
        x, v, filtered = state[:3]
        pipe = [spring * x + damper * filtered, *state[3:]]
        acting = [pipe[whole + 1], pipe[whole]] if rest else [pipe[whole]]
        mode, moved, gained = 0, 0.0, 0.0
        for held, span, cache in zip(acting, spans, caches, strict=True):
            after, speed, mode, *_ = plant_step(
                plant,
                cache,
                float(x + moved),
                float(v + gained),
                mode,
                -float(held),
                0.0,
                0.0,
                span,
            )
            moved, gained = after - x, speed - v
        filtered_gain = gain * (moved / wall.period - filtered)
        out = np.array([moved, gained, filtered_gain, *(np.array(pipe[:count]) - state[3:])])
        change[:, column] = out / units
    roots = np.linalg.eigvals(change)
    return float((2.0 * roots.real + np.abs(roots) ** 2).max())


# -- D4, D5, D6, the hand -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("beta", "alpha"),
    [(0.01, 0.01980100), (0.1, 0.18095238), (0.5, 0.6), (1.0, 0.66666667), (1.5, 0.42857143)],
)
def test_D4(beta: float, alpha: float) -> None:
    m = 0.1
    limit = stable_stiffness(SampledWall(0.0, beta * m / T, T), Device(m)).limit
    assert limit * T * T / m == pytest.approx(alpha, abs=1e-8)
    assert limit * T * T / m == pytest.approx(2 * beta * (2 - beta) / (2 + beta), rel=1e-12)


@pytest.mark.parametrize(
    ("damping", "delay", "limit", "linear"),
    [
        (0.0, 0, 200.0333, 200.0),
        (0.0, 1, 66.68518, 66.6667),
        (1.0, 0, 2178.4834, 2200.0),
        (1.0, 1, 725.38746, 733.333),
        (5.0, 1, 3211.4264, 3400.0),
        (50.0, 1, 14017.358, 33400.0),
    ],
)
def test_D5(damping: float, delay: float, limit: float, linear: float) -> None:
    wall = SampledWall(0.0, damping, T, delay)
    assert stable_stiffness(wall, Device(0.1, 0.1)).limit == pytest.approx(limit, rel=1e-6)
    assert linear_rule(wall, 0.1) == pytest.approx(linear, rel=1e-5)


def test_D6_pole_radius_and_angle() -> None:
    m, K = 0.1, 1000.0
    alpha = K * T * T / m
    mode = wall_mode(SampledWall(K, period=T), Device(m))
    assert mode.radius == pytest.approx(1.0024968828, abs=1e-9)
    assert mode.radius == pytest.approx(math.sqrt(1 + alpha / 2), rel=1e-14)
    angle = math.acos((1 - alpha / 4) / math.sqrt(1 + alpha / 2))
    assert mode.frequency * 2 * math.pi * T == pytest.approx(angle, rel=1e-12)


@pytest.mark.parametrize(
    ("period", "delay", "limit"),
    [(1e-3, 0, 10061.777), (1e-3, 1, 3370.578), (1e-4, 0, 100058.62), (1e-4, 1, 33366.20)],
)
def test_paper_hand(period: float, delay: float, limit: float) -> None:
    hand = held_device(0.0, 0.0, PAPER_HAND)
    assert stable_stiffness(SampledWall(0.0, 0.0, period, delay), hand).limit == pytest.approx(
        limit, rel=1e-6
    )


@pytest.mark.parametrize(
    ("period", "delay", "damping", "stiffness"),
    [
        (1e-3, 0, 0.05, 299.9),
        (1e-3, 1, 0.05, 100.0),
        (1e-3, 2, 0.05, 60.0),
        (0.25e-3, 0, 0.2, 2398.9),
        (0.25e-3, 1, 0.05, 400.0),
        (2e-3, 1, 0.0, 33.4),
        (2e-3, 1, 0.2, 99.6),
    ],
)
def test_stable_column_of_the_published_table(
    period: float, delay: float, damping: float, stiffness: float
) -> None:
    wall = SampledWall(0.0, damping, period, delay)
    assert stable_stiffness(wall, Device(0.1, 0.1)).limit == pytest.approx(stiffness, abs=0.06)


# -- special cases --------------------------------------------------------------------------------


def test_no_damping_at_all_is_unstable_for_every_spring() -> None:
    assert stable_stiffness(SampledWall(0.0, period=T), Device(0.1)).limit == 0.0
    assert stable_stiffness(SampledWall(0.0, -0.2, T), Device(0.1, 0.1)).limit == 0.0


def test_too_much_virtual_damping_is_unstable_without_a_spring() -> None:
    m = 0.1
    assert stable_stiffness(SampledWall(0.0, 2.01 * m / T, T), Device(m)).limit == 0.0
    assert stable_stiffness(SampledWall(0.0, 1.99 * m / T, T), Device(m)).limit > 0.0


def test_apex_of_the_stable_region() -> None:
    m = 0.1
    at = 2 * (math.sqrt(2) - 1)
    limit = stable_stiffness(SampledWall(0.0, at * m / T, T), Device(m)).limit
    assert limit * T * T / m == pytest.approx(4 * (3 - 2 * math.sqrt(2)), rel=1e-12)


def test_a_spring_can_restabilise_what_a_negative_damper_lets_go() -> None:
    wall = SampledWall(0.0, -24.0, 1.422e-3, 1.0, 1e-3)
    found = stable_stiffness(wall, Device(1e-3, 1.14))
    assert found.limit == 0.0
    for low, high in found.bands:
        inside = wall._replace(stiffness=math.sqrt(low * high))
        assert wall_mode(inside, Device(1e-3, 1.14)).growth < 0.0


def test_crossings_that_hide_between_two_angles_are_found() -> None:
    # The delay turns by half a turn just at the hand's resonance, where K(theta) is almost 0.
    wall = SampledWall(0.0, 0.0, 0.0003157085756482452, 18.81504089595842)
    device = Device(0.0007728820936298899, 7.206061518110321e-07, 206.12988488609838)
    found = stable_stiffness(wall, device)
    assert found.limit == pytest.approx(1.1, abs=0.1)
    assert found.frequency == pytest.approx(82.0, abs=0.2)
    assert simulated_growth(wall._replace(stiffness=0.99 * found.limit), device) < 0.0
    assert simulated_growth(wall._replace(stiffness=1.01 * found.limit), device) > 0.0


def test_senseless_devices_are_refused() -> None:
    with pytest.raises(ConfigError, match="mass: must be positive"):
        stable_stiffness(SampledWall(1.0), Device(0.0))
    with pytest.raises(ConfigError, match="damping: must be finite"):
        wall_mode(SampledWall(1.0), Device(1.0, math.nan))


# -- against the simulator's own map --------------------------------------------------------------


def agree(wall: SampledWall, device: Device) -> int:
    """Check every stable band's ends to 1 % on the simulated map; return how many were checked."""
    found = stable_stiffness(wall, device)
    edges = [edge for band in found.bands for edge in band if 0.0 < edge < math.inf]
    checked = 0
    for low, high in found.bands:
        for K, stable in (
            (low * 0.99, False),
            (low * 1.01, True),
            (high * 0.99, True),
            (high * 1.01, False),
        ):
            near = [edge for edge in edges if abs(K / edge - 1) < 0.0101]
            if not 0.0 < K < math.inf or len(near) != 1 or high < low * 1.03:
                continue
            growth = simulated_growth(wall._replace(stiffness=K), device)
            assert (growth < 0.0) == stable, (wall, device, found, K, growth)
            checked += 1
    return checked


@pytest.mark.slow
@given(
    mass=st.floats(-4, 1),
    share=st.floats(-8, -0.3),
    period=st.floats(math.log10(2e-5), -2),
    damper=st.one_of(st.just(0.0), st.floats(-2, 1.5)),
    sign=st.sampled_from([1.0, 1.0, -1.0]),
    delay=st.one_of(st.integers(0, 20).map(float), st.floats(0, 20)),
    tau=st.sampled_from([0.0, 1e-3, 1e-2]),
    grip=st.one_of(st.none(), st.floats(-1, 4)),
)
@settings(max_examples=120)
def test_boundary_agrees_with_the_simulated_map_to_one_percent(
    mass: float,
    share: float,
    period: float,
    damper: float,
    sign: float,
    delay: float,
    tau: float,
    grip: float | None,
) -> None:
    m, period = 10.0**mass, 10.0**period
    b = 10.0**share * m / period
    B = 0.0 if damper == 0.0 else sign * b * 10.0**damper
    k = 0.0 if grip is None else 10.0**grip
    assume(k * period**2 < 0.05 * m)  # a hand that the loop can see
    wall, device = SampledWall(0.0, B, period, delay, tau), Device(m, b, k)
    found = stable_stiffness(wall, device)
    agree(wall, device)
    if found.limit == 0.0:
        small = wall._replace(stiffness=1e-3 * min(b, abs(B) or b) / period / (1 + delay))
        assert simulated_growth(small, device) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.0, 1.0, 7.0, 20.0, 0.4, 12.5])
@pytest.mark.parametrize(
    ("mass", "damping", "period"),
    [
        (1.0, 1000.0, 2e-5),  # K to 1e8
        (1e-2, 1000.0, 2e-5),  # heavily damped
        (1e-2, 1e-6, 2e-5),  # b to 1e-6
        (1e-5, 1e-6, 2e-5),
        (1e-3, 1e-6, 1e-3),
        (10.0, 1e-2, 2e-5),
        (1e-4, 10.0, 1e-2),
        (0.1, 0.1, 1e-3),
    ],
)
def test_boundary_in_the_corners(mass: float, damping: float, period: float, delay: float) -> None:
    for ratio in (0.0, 0.5, 10.0):
        wall = SampledWall(0.0, ratio * damping, period, delay)
        found = stable_stiffness(wall, Device(mass, damping))
        if found.limit > 0.0:
            assert agree(wall, Device(mass, damping)) >= 2
        if ratio == 0.0:
            assert found.limit > 0.0


@given(st.floats(-3, 1), st.floats(-6, 2), st.floats(-4, -2), st.floats(0, 5), st.floats(-2, 6))
@settings(max_examples=tried(60))
def test_state_matrix_is_the_simulated_map(
    mass: float, damping: float, period: float, delay: float, stiffness: float
) -> None:
    wall = SampledWall(10.0**stiffness, 0.3, 10.0**period, delay, 1e-3)
    device = Device(10.0**mass, 10.0**damping, 100.0)
    roots = np.linalg.eigvals(wall_matrix(wall, device))
    expected = float((2.0 * roots.real + np.abs(roots) ** 2).max())
    assert simulated_growth(wall, device) == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_refined_growth_agrees_with_the_matrix_where_it_has_digits() -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        wall = SampledWall(
            10 ** rng.uniform(1, 4), rng.uniform(0, 1), T, float(rng.choice([0, 1, 3.5])), 1e-3
        )
        device = Device(10 ** rng.uniform(-2, 0), 10 ** rng.uniform(-2, 1), 50.0)
        radius = np.abs(1 + np.linalg.eigvals(wall_matrix(wall, device))).max()
        assert wall_mode(wall, device).radius == pytest.approx(radius, rel=1e-9)
