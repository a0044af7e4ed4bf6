"""Damping that a sampled wall needs: tables, closed forms, traps, and a test in the time domain."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.exact.bounds import find_negative, is_schur, reduce_fraction
from tautwave.analysis.walls.limits import (
    greatest_damping,
    greatest_stiffness,
    is_passive,
    least_rate,
)
from tautwave.analysis.walls.passivity import needed_damping, wall_leak
from tautwave.analysis.walls.sampled import PulseTransfer, SampledWall, wall_transfer
from tautwave.errors import ConfigError
from tests.analysis.reference.wall_bounds import (
    lag_rule,
    leaky_bound,
    prompt_bound,
    spring_bound,
    tustin_velocity,
)
from tests.examples import tried

T = 1e-3


def lifted_damping(transfer: PulseTransfer, period: float, delay: float, samples: int) -> float:
    """Needed damping over a window, from the quadratic form int u v + b v^2 >= 0 itself.

    Between two changes of the effort only the displacement counts, and constant speed is the
    cheapest way to get it: one piece a sample, two with a share of a period in the delay.
    """
    whole, rest = int(delay), delay - int(delay)
    response = np.zeros(samples)
    top = [float(a) for a in transfer.numerator]
    bottom = [float(a) for a in transfer.denominator]
    top = [0.0] * (len(bottom) - len(top)) + top
    for k in range(samples):
        response[k] = top[k] if k < len(top) else 0.0
        for i in range(1, min(k, len(bottom) - 1) + 1):
            response[k] -= bottom[i] * response[k - i]
        response[k] /= bottom[0]
    lags = [(whole + 1, rest), (whole, 1.0 - rest)] if rest else [(whole, 1.0)]
    pieces = len(lags)
    at_sample = np.zeros((samples, samples * pieces))
    for k in range(samples):
        at_sample[k, : k * pieces] = 1.0
    toeplitz = np.array(
        [[response[k - n] if k >= n else 0.0 for n in range(samples)] for k in range(samples)]
    )
    effort = toeplitz @ at_sample
    form = np.zeros((samples * pieces, samples * pieces))
    root = np.zeros(samples * pieces)
    for k in range(samples):
        for i, (lag, share) in enumerate(lags):
            root[k * pieces + i] = math.sqrt(share * period)
            if k >= lag:
                form[k * pieces + i] = effort[k - lag]
    form = 0.5 * (form + form.T) * root[:, None] * root[None, :]
    return float(-np.linalg.eigvalsh(form)[0])


# -- D1, D2, D3 -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("stiffness", "damping", "needed", "theta"),
    [(1000, 0.2, 0.7, math.pi), (1000, -0.2, 0.7, 0.0), (5000, 1.0, 3.5, math.pi)],
)
def test_D1(stiffness: float, damping: float, needed: float, theta: float) -> None:
    leak = wall_leak(SampledWall(stiffness, damping, T))
    assert leak.damping == pytest.approx(needed, abs=1e-6)
    assert leak.theta == pytest.approx(theta, abs=1e-9)
    assert leak.frequency == pytest.approx(theta / (2 * math.pi * T))


@pytest.mark.parametrize("delay", range(4))
def test_D2(delay: int) -> None:
    leak = wall_leak(SampledWall(1000.0, period=T, delay=delay))
    assert leak.damping == pytest.approx(delay + 0.5, abs=1e-6)
    assert leak.theta == 0.0


@pytest.mark.parametrize(
    ("damping", "filter_s", "needed"),
    [(0.5, 1e-3, 0.6666667), (-0.5, 1e-3, 1.0), (0.5, 5e-3, 0.5454545)],
)
def test_D3(damping: float, filter_s: float, needed: float) -> None:
    wall = SampledWall(1000.0, damping, T, filter_s=filter_s)
    assert wall_leak(wall).damping == pytest.approx(needed, abs=1e-6)


@pytest.mark.parametrize(
    ("period", "delay", "damping", "stiffness"),
    [
        (1e-3, 0, 0.0, 200.0),
        (1e-3, 1, 0.0, 66.7),
        (1e-3, 2, 0.0, 40.0),
        (0.25e-3, 0, 0.0, 800.0),
        (0.25e-3, 1, 0.0, 266.7),
        (2e-3, 1, 0.0, 33.3),
        (1e-3, 0, 0.05, 100.0),
        (1e-3, 1, 0.05, 73.2),
        (1e-3, 2, 0.05, 52.1),
        (0.25e-3, 0, 0.05, 400.0),
        (0.25e-3, 1, 0.05, 292.8),
        (2e-3, 1, 0.05, 36.6),
        (1e-3, 0, 0.2, 0.0),
        (1e-3, 1, 0.2, 0.0),
        (1e-3, 2, 0.2, 0.0),
        (0.25e-3, 1, 0.2, 0.0),
        (2e-3, 1, 0.2, 0.0),
    ],
)
def test_greatest_stiffness_of_the_published_table(
    period: float, delay: float, damping: float, stiffness: float
) -> None:
    wall = SampledWall(1.0, damping, period, delay)
    assert greatest_stiffness(wall, 0.1) == pytest.approx(stiffness, abs=0.05)


# -- closed forms ---------------------------------------------------------------------------------

stiffnesses = st.floats(-2, 8).map(lambda e: 10.0**e)
dampings = st.floats(-6, 3).map(lambda e: 10.0**e)
signed = st.one_of(st.just(0.0), dampings, dampings.map(lambda b: -b))
periods = st.floats(math.log10(2e-5), -1).map(lambda e: 10.0**e)
filters = st.one_of(st.just(0.0), st.floats(-6, 1).map(lambda e: 10.0**e))
delays = st.one_of(st.integers(0, 20).map(float), st.floats(0.0, 20.0))


@given(stiffnesses, signed, periods, filters)
@settings(max_examples=tried(60))
def test_prompt_wall_equals_its_closed_form(K: float, B: float, period: float, tau: float) -> None:
    wall = SampledWall(K, B, period, 0.0, tau)
    leak = wall_leak(wall)
    assert leak.damping == pytest.approx(prompt_bound(wall), rel=1e-9)
    assert leak.upper == pytest.approx(leak.damping, rel=1e-9)
    assert leak.upper >= leak.supremum


@given(stiffnesses, periods, delays)
@settings(max_examples=tried(40))
def test_delayed_spring_equals_its_closed_form(K: float, period: float, delay: float) -> None:
    wall = SampledWall(K, 0.0, period, delay)
    assert wall_leak(wall).damping == pytest.approx(spring_bound(wall), rel=1e-9)
    assert spring_bound(wall) >= lag_rule(wall) * (1 - 1e-12)
    assert spring_bound(wall) <= lag_rule(wall) * 1.0775


def test_linear_rule_is_optimistic_by_up_to_7_7_percent() -> None:
    walls = [SampledWall(1000.0, period=T, delay=f / 1000) for f in range(1001)]
    worst = max(spring_bound(wall) / lag_rule(wall) for wall in walls)
    assert worst == pytest.approx(1.0774, abs=2e-4)


def test_damper_with_whole_delay_is_a_cosine() -> None:
    # (K T / 2)(1 + 2 sum cos i theta) - B cos((d + 1) theta), on a fine grid from below.
    theta = np.linspace(1e-6, math.pi, 200_001)
    for K, B, d in [(100.0, 0.3, 1), (100.0, 0.3, 4), (3000.0, -2.0, 7), (0.0, 1.0, 3)]:
        kernel = 1.0 + 2.0 * sum(np.cos(i * theta) for i in range(1, d + 1))
        grid = float((0.5 * K * T * kernel - B * np.cos((d + 1) * theta)).max())
        found = wall_leak(SampledWall(K, B, T, d)).damping
        assert grid <= found * (1 + 1e-12)
        assert found == pytest.approx(grid, rel=1e-7)


@given(
    st.lists(st.integers(-300, 300).map(lambda n: n / 100), min_size=1, max_size=4),
    st.lists(st.floats(-0.6, 0.6), min_size=3, max_size=3),
    st.floats(0, 5),
)
@settings(max_examples=tried(40))
def test_bound_is_never_below_any_frequency(
    top: list[float], poles: list[float], delay: float
) -> None:
    # The definition, evaluated in floats: largest eigenvalue of the rank-two form.
    transfer = PulseTransfer(tuple(top), tuple(np.poly(poles)))
    leak = needed_damping(transfer, T, delay)
    theta = np.linspace(0.05, math.pi, 4001)
    z = np.exp(1j * theta)
    value = np.polyval([float(a) for a in transfer.numerator], z)
    value = value / np.polyval([float(a) for a in transfer.denominator], z)
    c = (1.0 - 1.0 / z) * value / T
    whole, rest = int(delay), delay - int(delay)
    turned = c * z**-whole * ((1.0 - rest) + rest / z)
    scale = T * T / (2.0 * (1.0 - np.cos(theta)))
    root = np.sqrt(np.maximum(np.abs(c) ** 2 - turned.imag**2, 0.0))
    needed = 0.5 * scale * (root + turned.real)
    rounding = 1e-6 * T * float(np.abs(value).max())  # of the root, where it all but vanishes
    assert max(leak.upper, 0.0) >= needed.max() - rounding
    if leak.theta > 0.06:
        assert leak.damping <= needed.max() * (1 + 1e-3) + rounding


# -- the time domain, with no frequency in it -----------------------------------------------------


@pytest.mark.parametrize(
    ("transfer", "delay"),
    [
        (wall_transfer(SampledWall(1000.0, 0.0, T)), 0.0),
        (wall_transfer(SampledWall(1000.0, 0.2, T)), 0.0),
        (wall_transfer(SampledWall(1000.0, -0.2, T)), 0.0),
        (wall_transfer(SampledWall(1000.0, 0.5, T, filter_s=2e-3)), 0.0),
        (wall_transfer(SampledWall(1000.0, 0.0, T)), 2.0),
        (wall_transfer(SampledWall(1000.0, 0.0, T)), 0.25),
        (wall_transfer(SampledWall(1000.0, 0.8, T)), 1.6),
        (wall_transfer(SampledWall(200.0, -0.5, T, filter_s=1e-3)), 0.5),
        (PulseTransfer((2.0, -1.0, 0.3), (1.0, -0.5, 0.6)), 0.0),
        (PulseTransfer((2.0, -1.0, 0.3), (1.0, -0.5, 0.6)), 1.3),
    ],
)
def test_lifted_form_reaches_the_bound_from_below(transfer: PulseTransfer, delay: float) -> None:
    bound = needed_damping(transfer, T, delay).damping
    short, long = (lifted_damping(transfer, T, delay, n) for n in (30, 110))
    assert short <= long <= bound * (1 + 1e-9)
    assert long == pytest.approx(bound, rel=1.2e-2)


def test_lifted_form_grows_without_bound_for_tustin_and_for_any_integrator() -> None:
    for transfer in (
        tustin_velocity(0.2, T),
        PulseTransfer((0.0, 1.0), (1.0, -1.0)),
        PulseTransfer((0.0, -1.0), (1.0, -1.0)),
    ):
        assert needed_damping(transfer, T).damping == math.inf
        some = [lifted_damping(transfer, T, 0.0, n) for n in (20, 40, 80)]
        assert some[1] > 1.8 * some[0]
        assert some[2] > 1.8 * some[1]
    assert lifted_damping(tustin_velocity(0.2, T), T, 0.0, 20) == pytest.approx(3.8, abs=0.1)


# -- traps ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.0, 0.25])
def test_damping_to_spare_is_proved_as_tightly(delay: float) -> None:
    """Of E = c: y**2 - c y (1 - f + f (2 cos theta + 1)) - f (1 - f) c**2 = 0, at theta = pi."""
    leak = needed_damping(PulseTransfer((-1000.0,)), T, delay)
    level = -1.0 + 2.0 * delay
    least = 0.25 * (level + math.sqrt(level**2 + 4.0 * delay * (1.0 - delay)))
    assert leak.supremum == pytest.approx(least if delay else -0.5, rel=1e-12)
    assert leak.damping == max(leak.supremum, 0.0)
    assert leak.supremum < leak.upper < leak.supremum + 1e-10
    assert leak.theta == pytest.approx(math.pi if delay else 0.0)


def test_tustin_is_infinite_at_half_the_rate_and_leaky_is_not() -> None:
    leak = needed_damping(tustin_velocity(0.2, T), T)
    assert (leak.damping, leak.theta) == (math.inf, math.pi)
    leaky = needed_damping(tustin_velocity(0.2, T, 0.5), T)
    assert leaky.damping == pytest.approx(leaky_bound(0.0, 0.2, T, 0.5), rel=1e-12)
    nearly = needed_damping(tustin_velocity(0.2, T, 1.0 - 1e-9), T)
    assert nearly.damping == pytest.approx(leaky_bound(0.0, 0.2, T, 1.0 - 1e-9), rel=1e-9)


def test_poles_outside_and_on_the_circle_are_infinite_and_cancelled_ones_are_not() -> None:
    assert needed_damping(PulseTransfer((1.0,), (1.0, -1.5)), T).damping == math.inf
    assert needed_damping(PulseTransfer((1.0, 0.0, 0.0), (1.0, 0.0, 1.0)), T).damping == math.inf
    held = needed_damping(PulseTransfer((1000.0, -1000.0), (1.0, -1.0)), T)
    assert held.damping == pytest.approx(0.5)
    assert is_schur([1.0, -0.9, 0.0, 0.0])
    assert not is_schur([1.0, -1.0])
    assert is_schur([1.0, -(1.0 - 1e-15)])


def test_narrow_peak_that_a_grid_misses_is_found() -> None:
    # A resonance of relative width 1e-9: no grid of 2^14 points sees it.
    r, angle = 1.0 - 1e-9, 1.2345678
    transfer = PulseTransfer((1e-6, 0.0, 0.0), (1.0, -2.0 * r * math.cos(angle), r * r))
    leak = needed_damping(transfer, T)
    assert leak.theta == pytest.approx(angle, abs=1e-6)
    theta = np.linspace(1e-4, math.pi, 2**14)
    z = np.exp(1j * theta)
    value = 1e-6 * z**2 / np.polyval([float(a) for a in transfer.denominator], z)
    grid = 0.5 * T * (value.real - value.imag / np.tan(0.5 * theta))
    assert leak.damping > 100.0 * grid.max()


def test_touching_zero_is_proved_and_a_hair_below_is_found() -> None:
    # (3 t - 1)^2 touches zero at a place no float is; 1e-30 less is negative.
    touch = [1, -6, 9]
    assert find_negative([10**30 * a + b for a, b in zip(touch, [1, 0, 0], strict=True)]) is None
    found = find_negative([10**30 * a - b for a, b in zip(touch, [1, 0, 0], strict=True)])
    assert found is not None
    assert abs(float(found[0]) - 1 / 3) < 1e-12


def test_common_factors_are_cancelled_exactly() -> None:
    top, bottom = reduce_fraction([1.0, -3.0, 2.0], [1.0, -2.5, 1.0])
    assert [a / bottom[0] for a in top] == [1, -1]
    assert [a / bottom[0] for a in bottom] == [1, Fraction(-1, 2)]


@pytest.mark.parametrize(
    ("transfer", "period", "delay", "words"),
    [
        (PulseTransfer((1.0, 0.0), (1.0,)), T, 0.0, "future"),
        (PulseTransfer((1.0,), (0.0, 0.0)), T, 0.0, "denominator is zero"),
        (PulseTransfer((math.nan,)), T, 0.0, "finite"),
        (PulseTransfer((1.0,)), 0.0, 0.0, "period"),
        (PulseTransfer((1.0,)), T, -1.0, "delay"),
    ],
)
def test_senseless_input_is_one_sentence(
    transfer: PulseTransfer, period: float, delay: float, words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        needed_damping(transfer, period, delay)
    with pytest.raises(ConfigError, match="stiffness: must not be negative"):
        wall_leak(SampledWall(-1.0))


# -- inverse questions ----------------------------------------------------------------------------


@given(signed, dampings, periods, delays, filters)
@settings(max_examples=tried(40))
def test_greatest_stiffness_passes_and_one_percent_more_does_not(
    B: float, b: float, period: float, delay: float, tau: float
) -> None:
    wall = SampledWall(0.0, B, period, delay, tau)
    limit = greatest_stiffness(wall, b)
    if limit > 0.0:
        assert is_passive(wall._replace(stiffness=limit), b)
        assert not is_passive(wall._replace(stiffness=1.01 * limit + 0.01 * b / period), b)
    else:
        assert not is_passive(wall._replace(stiffness=1e-3 * b / period), b)


@given(stiffnesses, dampings, periods, st.floats(0, 3), filters)
@settings(max_examples=tried(40))
def test_greatest_damping_passes_and_more_does_not(
    K: float, b: float, period: float, delay: float, tau: float
) -> None:
    wall = SampledWall(K, 0.0, period, delay, tau)
    limit = greatest_damping(wall, b)
    if limit == -math.inf:
        assert not is_passive(wall, b)
    else:
        assert is_passive(wall._replace(damping=limit), b)
        assert not is_passive(wall._replace(damping=limit + 0.01 * (b + abs(limit))), b)


def test_least_rate() -> None:
    wall = SampledWall(5000.0, 0.0, T, 1.0)
    assert least_rate(wall, 2.418) == pytest.approx(7.5 / 2.418 * 1000, rel=1e-5)
    assert least_rate(wall, 8.0) == 1000.0
    damped = SampledWall(1000.0, 0.2, T)
    assert least_rate(damped, 0.1) == math.inf
    assert least_rate(damped, 0.3) == pytest.approx(5000.0, rel=1e-5)
    fixed = SampledWall(1000.0, 0.0, T)
    assert least_rate(fixed, 0.1, delay_s=1e-3) == math.inf
    found = least_rate(fixed, 0.1, delay_s=2e-5)
    assert is_passive(SampledWall(1000.0, 0.0, 1 / found, 2e-5 * found), 0.1)
    assert spring_bound(SampledWall(1000.0, 0.0, 1 / found, 2e-5 * found)) == pytest.approx(0.1)
