"""D13: waves between rates, across gaps and through rounding; several planes at once."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.walls.sampled import SampledWall
from tautwave.errors import ConfigError
from tests.analysis.reference.conversion import (
    conversion_ratio,
    delay_gain,
    held_ratio,
    hold_matrix,
    mean_magnitude,
    mean_matrix,
    packet_policies,
    pick_matrix,
    round_wave,
    rounding_ratio,
    truncate_wave,
)
from tests.analysis.reference.planes import additive_factor, planes_leak, stiffest_factor
from tests.examples import tried


def test_D13_magnitude_of_the_mean() -> None:
    assert mean_magnitude(20.0, 10, 1e-3) == pytest.approx(0.936105, abs=5e-7)
    assert mean_magnitude(0.0, 10, 1e-3) == 1.0
    t = np.arange(200_000)
    blocks = np.cos(2 * np.pi * 20.0 * 1e-3 * t + 0.3).reshape(-1, 10).mean(axis=1)
    assert math.sqrt(2.0 * np.mean(blocks**2)) == pytest.approx(0.936105, rel=1e-5)


@pytest.mark.parametrize("count", [1, 2, 10, 37])
def test_D13_mean_and_hold_are_passive_and_picking_is_not(count: int) -> None:
    assert conversion_ratio(mean_matrix(count)) == pytest.approx(1.0, rel=1e-12)
    assert conversion_ratio(hold_matrix(count)) == pytest.approx(1.0, rel=1e-12)
    assert conversion_ratio(pick_matrix(count)) == pytest.approx(count, rel=1e-12)
    both = hold_matrix(count) @ mean_matrix(count)
    assert conversion_ratio(both) == pytest.approx(1.0, rel=1e-12)


@settings(max_examples=tried(60), deadline=None)
@given(st.lists(st.floats(-10, 10), min_size=12, max_size=12), st.sampled_from([2, 3, 4, 6]))
def test_D13_energy_falls_and_the_integral_is_exact(waves: list[float], count: int) -> None:
    fast = np.array(waves).reshape(-1, count)
    slow = fast @ mean_matrix(count).T
    held = slow @ hold_matrix(count).T
    assert float((held**2).sum()) <= float((fast**2).sum()) * (1 + 1e-12) + 1e-300
    assert float(held.sum()) == pytest.approx(float(fast.sum()), abs=1e-10)


def test_D13_rounding_and_holding() -> None:
    assert rounding_ratio(0.6, 1.0) == pytest.approx(2.77778, abs=1e-5)
    assert rounding_ratio(0.5 + 1e-9, 1.0) == pytest.approx(4.0, rel=1e-7)
    assert rounding_ratio(0.0, 1.0) == 1.0
    assert held_ratio(100) == 101.0


@settings(max_examples=tried(60), deadline=None)
@given(st.floats(-50, 50), st.floats(1e-3, 5))
def test_truncating_never_adds(wave: float, step: float) -> None:
    assert abs(truncate_wave(wave, step)) <= abs(wave) * (1 + 1e-15)
    assert abs(round_wave(wave, step)) <= 2 * abs(wave) * (1 + 1e-9)


def test_the_table_of_policies_against_trains_of_losses() -> None:
    table = {policy.name: policy for policy in packet_policies(9)}
    assert {name for name, policy in table.items() if policy.passive} == {
        "null", "play-out buffer", "scaled hold", "wave integral",
    }  # fmt: skip
    assert all(policy.passive == (policy.energy_ratio <= 1.0) for policy in table.values())
    sent = np.ones(20)
    held = np.repeat(sent, 10)
    assert float((held**2).sum() / (sent**2).sum()) == table["hold last"].energy_ratio


def test_gain_of_a_moving_delay() -> None:
    # tau = .1 + .08 sin(2 pi 1.5 t): rate .7540, gain .4960
    rate = 0.08 * 2 * math.pi * 1.5
    assert rate == pytest.approx(0.7540, abs=5e-5)
    assert delay_gain(rate) == pytest.approx(0.4960, abs=5e-5)
    assert delay_gain(1.5) == 0.0


# -- planes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("degrees", "factor"), [(30, 1.8660), (60, 1.5), (90, 1.0), (120, 1.5)])
def test_two_planes(degrees: float, factor: float) -> None:
    angle = math.radians(degrees)
    assert additive_factor(angle) == pytest.approx(factor, abs=5e-5)
    normals = [(1.0, 0.0), (2.0 * math.cos(angle), 2.0 * math.sin(angle))]
    assert stiffest_factor(normals) == pytest.approx(additive_factor(angle), rel=1e-12)
    assert stiffest_factor(normals, together=1) == pytest.approx(1.0)


def test_corners_in_space() -> None:
    assert stiffest_factor(np.eye(3).tolist()) == pytest.approx(1.0)
    assert stiffest_factor([(0, 0, 1)] * 3) == pytest.approx(3.0)
    with pytest.raises(ConfigError, match="normal"):
        stiffest_factor([(0.0, 0.0)])


def test_planes_need_as_much_more_damping() -> None:
    wall = SampledWall(1000.0, 0.2, 1e-3)
    factor = additive_factor(math.radians(60))
    assert planes_leak(wall, factor).damping == pytest.approx(1.5 * 0.7, rel=1e-9)
    assert planes_leak(wall, 1.0).damping == pytest.approx(0.7, rel=1e-9)
