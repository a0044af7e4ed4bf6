"""Wave variables and the wave filter: power identities, inverses, passivity."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.wave_filter import filter_gain, filter_step
from tests.laws.waves import decode_effort, decode_velocity, encode_wave

numbers = st.floats(-1e3, 1e3)
impedances = st.floats(1e-3, 1e3)
T = 1e-3


@given(numbers, numbers, impedances)
def test_half_the_difference_of_squares_is_the_power(effort: float, v: float, b: float) -> None:
    leaving = encode_wave(effort, v, b)
    arriving = (b * v - effort) / math.sqrt(2.0 * b)
    scale = leaving * leaving + arriving * arriving + 1e-12
    assert abs(0.5 * (leaving**2 - arriving**2) - effort * v) <= 1e-13 * scale


@given(numbers, numbers, impedances)
def test_decoding_undoes_encoding(arriving: float, v: float, b: float) -> None:
    effort = decode_effort(arriving, v, b)
    scale = abs(v) * b + math.sqrt(2.0 * b) * abs(arriving) + 1e-12
    assert abs(decode_velocity(arriving, effort, b) - v) <= 1e-13 * scale / b
    leaving = encode_wave(effort, v, b)
    # What leaves and what arrives add up to sqrt(2 b) times the velocity.
    assert abs(leaving + arriving - math.sqrt(2.0 * b) * v) <= 1e-13 * scale / math.sqrt(b)


@given(st.lists(st.floats(-10, 10), min_size=1, max_size=60), st.floats(0.1, 500.0))
def test_filter_account_closes_and_never_gives_more_than_it_got(
    waves: list[float], corner: float
) -> None:
    gain = filter_gain(corner, T)
    state = absorbed = dissipated = flow = 0.0
    for wave in waves:
        state, stored, lost = filter_step(gain, T, state, wave)
        assert lost >= 0.0
        absorbed += 0.5 * T * (wave * wave - state * state)
        dissipated += lost
        flow += 0.5 * T * (wave * wave + state * state) + stored
        assert abs(absorbed - stored - dissipated) <= 1e-13 * flow
        assert absorbed >= -1e-13 * flow


@pytest.mark.parametrize("corner", [1.0, 10.0, 100.0, 500.0])
def test_filter_never_amplifies_and_passes_what_is_constant(corner: float) -> None:
    gain = filter_gain(corner, T)
    angle = np.linspace(0.0, np.pi, 500)
    q = np.exp(-1j * angle)
    response = np.abs(gain / (1.0 - (1.0 - gain) * q))
    assert response.max() <= 1.0 + 1e-14
    measured = 0.0
    for _ in range(10_000):
        measured, _, _ = filter_step(gain, T, measured, 1.0)
    assert measured == pytest.approx(1.0, abs=1e-12)


def test_filter_has_the_corner_it_is_asked_for() -> None:
    # Step response of a first-order low-pass: 1 - exp(-2 pi f t), exact at the samples.
    gain, state = filter_gain(20.0, T), 0.0
    for k in range(1, 50):
        state, _, _ = filter_step(gain, T, state, 1.0)
        assert state == pytest.approx(1.0 - math.exp(-2.0 * math.pi * 20.0 * k * T), rel=1e-12)
