"""What a receiver gives out: within its funds, debts last, and what is in time is cut last."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.counters import ENERGY_QUANTUM, WAVE_QUANTUM
from tautwave.laws.receiver import output_wave, receiver_params, wanted_wave

PERIOD = 0.5e-3
PARAMS = receiver_params(PERIOD, sender_period=PERIOD, depth=0.01)


def test_the_speed_that_a_wave_costs_is_that_of_its_energy() -> None:
    """The law's bound alone: |out| <= sqrt(funds / K)."""
    p = PARAMS
    funds = round(1e-3 / ENERGY_QUANTUM)
    wave = output_wave(p, funds, 0, 1 << 50, 0.0, 2.0**50) * WAVE_QUANTUM / PERIOD
    assert 0.5 * PERIOD * wave * wave == pytest.approx(1e-3, rel=1e-6)
    lasting = output_wave(p, funds, 10**10, 0, 0.0, 2.0**50) * WAVE_QUANTUM / PERIOD
    assert lasting == pytest.approx(2.0 * 1e-3 / (10**10 * WAVE_QUANTUM), rel=1e-6)


@given(
    st.floats(0.0, 3.0), st.integers(1, 10**10), st.integers(-(10**9), 10**10),
    st.sampled_from([-0.5, 0.0, 0.3, 0.6, 0.9, 1.5]), st.sampled_from([1, -1]),
)  # fmt: skip
@example(1.0, 10**10, 10**9, 0.6, 1)  # cut to the mean
@example(1.8, 10**8, 10**9, 0.0, -1)  # cut by no more than keeps the energy for each count
def test_the_energy_for_each_count_of_a_debt_never_falls(
    share: float, rest: int, timely: int, mean: float, sign: int
) -> None:
    """Whatever is paid, or kept back; and what is in time is cut to its mean at most."""
    p = PARAMS
    rest, timely = sign * rest, sign * timely
    cost = p.scale * (1.0 * timely * timely)
    spare = math.ceil(share * p.scale * (1.0 * abs(rest) * abs(timely)))
    funds = math.ceil(cost) + spare + 1  # what is in time came with its energy
    wave = output_wave(p, funds, rest, timely, mean * timely, wanted_wave(p, rest, timely))
    spent = p.scale * (1.0 * wave * wave)
    assert spent <= funds
    left = abs(rest + timely - wave)
    # A count of rounding, and the relative one of floats.
    slack = p.scale * (2.0 * abs(wave) + 1.0) + 1e-9 * funds + 2.0
    assert (funds - 1 - spent) * abs(rest) >= (funds - 1 - cost) * left - slack * (abs(rest) + left)
    if rest * timely > 0:
        assert abs(wave) >= min(1.0, max(0.0, mean)) * abs(timely) - 1
