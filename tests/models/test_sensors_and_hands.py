from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.limit import truncate
from tautwave.models.encoder import quantise
from tautwave.models.hand import PAPER_HAND, rotary_hand
from tautwave.models.reference import minimum_jerk_position, ramp_gain, sine_position

values = st.floats(-1e6, 1e6)
quanta = st.floats(1e-9, 1e3)


@given(values, quanta)
def test_quantise_takes_the_nearest_multiple(value: float, quantum: float) -> None:
    got = quantise(value, quantum)
    assert abs(got - value) <= 0.5 * quantum * (1.0 + 1e-9) + 1e-15 * abs(value)
    assert quantise(got, quantum) == got


@given(values, quanta)
@example(0.3, 0.1)
@example(-0.7, 0.1)
@example(5e-324, 1e-9)
def test_truncate_never_enlarges_and_repeats_to_the_bit(value: float, quantum: float) -> None:
    got = truncate(value, quantum)
    assert abs(got) <= abs(value)
    assert abs(value) - abs(got) < quantum * (1.0 + 1e-9) + 1e-15 * abs(value)
    assert truncate(got, quantum) == got
    assert truncate(-value, quantum) == -got


@given(st.integers(-(10**6), 10**6), quanta)
def test_multiples_stay(count: int, quantum: float) -> None:
    value = count * quantum
    assert truncate(value, quantum) == value
    assert quantise(value, quantum) == value


@pytest.mark.parametrize("step", [quantise, truncate])
def test_quantum_zero_and_huge_values_change_nothing(step: object) -> None:
    assert callable(step)
    assert step(0.1234, 0.0) == 0.1234
    assert step(1e300, 1e-9) == 1e300
    assert step(math.inf, 0.1) == math.inf
    assert math.isnan(step(math.nan, 0.1))


def test_the_paper_hand() -> None:
    assert math.sqrt(PAPER_HAND.stiffness / PAPER_HAND.mass) / (2 * math.pi) == pytest.approx(
        9.7621, abs=1e-4
    )
    zeta = PAPER_HAND.damping / (2.0 * math.sqrt(PAPER_HAND.stiffness * PAPER_HAND.mass))
    assert zeta == pytest.approx(0.285024, abs=1e-6)


def test_a_rotary_hand_keeps_its_frequency() -> None:
    hand = rotary_hand(*PAPER_HAND, 0.075)
    assert hand.stiffness / hand.mass == pytest.approx(538.0 / 0.143, rel=1e-14)
    assert hand.mass == pytest.approx(0.143 * 0.075**2, rel=1e-14)
    assert rotary_hand(*PAPER_HAND, 1.0) == PAPER_HAND


def test_minimum_jerk_is_the_quintic() -> None:
    for i in range(-2, 13):
        s = min(max(i / 10.0, 0.0), 1.0)
        want = 2.0 + 3.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)
        assert minimum_jerk_position(1.0 + i / 5.0, 1.0, 2.0, 3.0, 5.0) == pytest.approx(
            want, rel=1e-15
        )
    assert minimum_jerk_position(9.0, 1.0, 0.1, 3.0, 0.7) == 0.7
    assert minimum_jerk_position(2.0, 2.0, 0.0, 2.0, 1.0) == 1.0


def test_minimum_jerk_ends_at_rest() -> None:
    h = 1e-4
    for t in (0.0, 1.0):
        around = [minimum_jerk_position(t + k * h, 0.0, 0.0, 1.0, 1.0) for k in (-1, 0, 1)]
        assert abs(around[2] - around[0]) / (2 * h) < 1e-6
        assert abs(around[2] - 2 * around[1] + around[0]) / h**2 < 0.01


def test_sine_and_ramp() -> None:
    assert sine_position(0.25, 1.0, 2.0, 0.0) == pytest.approx(2.0)
    assert ramp_gain(0.0, 0.0) == 1.0
    assert ramp_gain(0.5, 1.0) == 0.5
    assert ramp_gain(2.0, 1.0) == 1.0
