"""Limit cycles: prediction against the models, and the energy of one penetration."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.limit_cycle import (
    REST,
    UNBOUNDED,
    predict_limit_cycle,
    simulate_limit_cycle,
)
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import stable_stiffness
from tautwave.errors import ConfigError

AGREEMENT = 0.03
"""Relative agreement of depth, frequency and peak effort; the height, a difference, has twice."""


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("mass", "damping", "wall", "bias"),
    [
        (0.1, 0.1, SampledWall(1000.0, 0.0, 1e-3), 1.0),
        (0.1, 0.3, SampledWall(1000.0, 0.0, 1e-3), 1.0),
        (0.1, 0.45, SampledWall(1000.0, 0.0, 1e-3), 5.0),
        (0.1, 0.1, SampledWall(1000.0, 0.2, 1e-3), 1.0),
        (0.1, 0.3, SampledWall(1000.0, 0.0, 1e-3, 1.0), 3.0),
        (0.1, 0.3, SampledWall(1000.0, 0.2, 1e-3, 1.4), 0.3),
        (1.0, 0.5, SampledWall(2000.0, 0.0, 1e-3), 1.0),
        (1.0, 0.5, SampledWall(2000.0, 0.3, 1e-3, 0.0, 1e-3), 1.0),
        (0.05, 0.2, SampledWall(3000.0, 0.3, 2e-4, 3.0, 1e-4), 1.0),
        (0.1, 0.1, SampledWall(4000.0, 0.0, 1e-3), 1.0),
    ],
)
def test_prediction_agrees_with_simulation(
    mass: float, damping: float, wall: SampledWall, bias: float
) -> None:
    device = Device(mass, damping)
    said = predict_limit_cycle(wall, device, bias)
    fall = 1.3 * said.height * wall.stiffness / bias  # from above; it takes many bounces to settle
    seen = simulate_limit_cycle(wall, device, bias, samples=40000, fall=fall)
    assert said.depth == pytest.approx(seen.depth, rel=AGREEMENT)
    assert said.frequency == pytest.approx(seen.frequency, rel=AGREEMENT)
    assert said.peak_effort == pytest.approx(seen.peak_effort, rel=AGREEMENT)
    assert said.height == pytest.approx(seen.height, rel=2 * AGREEMENT)


@pytest.mark.slow
@pytest.mark.nightly
@given(st.floats(0.1, 100.0), st.floats(0.05, 0.45))
@settings(max_examples=20)
def test_everything_but_the_frequency_grows_with_the_bias(bias: float, damping: float) -> None:
    wall, device = SampledWall(1000.0), Device(0.1, damping)
    one, other = (predict_limit_cycle(wall, device, b) for b in (1.0, bias))
    assert other.depth == pytest.approx(bias * one.depth, rel=1e-6)
    assert other.peak_effort == pytest.approx(bias * one.peak_effort, rel=1e-6)
    assert other.frequency == pytest.approx(one.frequency, rel=1e-6)


@pytest.mark.slow
def test_a_stable_wall_rests_and_an_undamped_device_never_does() -> None:
    device = Device(0.1, 0.3)
    for wall in (SampledWall(0.0), SampledWall(0.0, 0.2, 1e-3, 1.4)):
        limit = stable_stiffness(wall, device).limit
        below, above = wall._replace(stiffness=0.95 * limit), wall._replace(stiffness=1.05 * limit)
        assert predict_limit_cycle(below, device, 1.0) == REST
        assert simulate_limit_cycle(below, device, 1.0, samples=20000, fall=0.1) == REST
        assert predict_limit_cycle(above, device, 1.0).depth > 0.0
        assert simulate_limit_cycle(above, device, 1.0, fall=3.0).depth > 0.0
    assert predict_limit_cycle(SampledWall(1000.0), Device(0.1), 1.0) == UNBOUNDED


def test_faster_than_a_hand_is_the_interface() -> None:
    assert predict_limit_cycle(SampledWall(1000.0), Device(0.1, 0.45), 1.0).involuntary
    assert not predict_limit_cycle(SampledWall(1000.0), Device(0.1, 0.1), 1.0).involuntary


def test_coulomb_friction_stops_a_slow_cycle() -> None:
    wall, device = SampledWall(1000.0), Device(0.1, 0.45)
    assert simulate_limit_cycle(wall, device, 1.0, coulomb=0.0, fall=3.0).depth > 0.0
    assert simulate_limit_cycle(wall, device, 1.0, coulomb=0.2, fall=0.1) == REST


def test_senseless_questions_are_refused() -> None:
    wall = SampledWall(1000.0)
    with pytest.raises(ConfigError, match="no spring"):
        predict_limit_cycle(wall, Device(0.1, 0.1, 5.0), 1.0)
    with pytest.raises(ConfigError, match="bias"):
        simulate_limit_cycle(wall, Device(0.1, 0.1), -1.0)
    with pytest.raises(ConfigError, match="not a slow oscillation"):
        predict_limit_cycle(SampledWall(10.0, 300.0, 1e-3), Device(0.1, 0.1), 1.0)
    assert math.isinf(UNBOUNDED.depth)
