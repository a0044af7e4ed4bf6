"""The observer: unbiased where it stands, exact on its own model, fading with time."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.observer import observe, observer_params, plain_observer

T = 0.5e-3
MASS = 1.1e-3
POLES = st.floats(0.0, 0.9)


@given(POLES, st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_a_standing_device_under_an_effort_has_no_velocity(
    pole: float, place: float, effort: float
) -> None:
    """Whatever the mass bound: what is not known of it goes into the acceleration from outside."""
    p = observer_params(T, MASS, pole)
    state = 0.0, 0.0, 0.0
    for _ in range(1000):
        state = observe(p, *state, place, effort, 1.0)
    assert state[0] == pytest.approx(place, abs=1e-12)
    assert state[1] == pytest.approx(0.0, abs=1e-9)
    assert state[2] == pytest.approx(effort / MASS, rel=1e-9, abs=1e-6)


@given(POLES, st.integers(1, 4))
def test_poles_are_where_they_are_said_to_be(pole: float, periods: int) -> None:
    p = observer_params(T, MASS, pole)
    matrix = np.array([observe(p, *unit, 0.0, 0.0, float(periods)) for unit in np.eye(3)]).T
    scaled = np.diag([1.0, T, T * T]) @ matrix @ np.diag([1.0, 1.0 / T, 1.0 / T**2])
    wanted = np.poly([pole**periods] * 3)  # a triple pole is badly conditioned, its polynomial not
    assert np.poly(scaled) == pytest.approx(wanted, abs=1e-9)


@given(POLES, st.lists(st.integers(1, 3), min_size=40, max_size=60), st.floats(-20.0, 20.0))
def test_follows_a_constant_acceleration_without_an_error(
    pole: float, spans: list[int], push: float
) -> None:
    """Also where samples are missing."""
    p = observer_params(T, MASS, pole)
    state = 0.3, 2.0, push
    x, v = 0.3, 2.0
    for periods in spans:
        span = periods * T
        x, v = x + span * v + 0.5 * span * span * push, v + span * push
        state = observe(p, *state, x, 0.0, float(periods))
    assert state == pytest.approx((x, v, push), rel=1e-9, abs=1e-9)


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-0.5, 0.5)), max_size=20))
def test_plain_is_the_difference_quotient_and_the_known_effort(
    steps: list[tuple[float, float]],
) -> None:
    p = plain_observer(T, MASS)
    state = 0.0, 0.0, 0.0
    for sample, effort in steps:
        before = state[0]
        state = observe(p, *state, sample, effort, 1.0)
        wanted = (sample - before) / T - 0.5 * T / MASS * effort
        assert state == pytest.approx((sample, wanted, 0.0), rel=1e-9, abs=1e-9)
