"""Counters: rounding is on the safe side in exact arithmetic, and no sum of roundings grows."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.counters import (
    ENERGY_QUANTUM,
    HALF,
    SPAN,
    WAVE_QUANTUM,
    added,
    apart,
    charged,
    credited,
    energy_scale,
    rounded_wave,
)

counters = st.integers(0, SPAN - 1)
periods = st.sampled_from([1e-4, 0.5e-3, 1e-3, 2e-3])
waves = st.floats(-1000.0, 1000.0)
EXACT_QUANTUM = Fraction(1, 2**40)


@given(counters, st.integers(-HALF, HALF - 1))
def test_a_change_is_what_lies_between(counter: int, change: int) -> None:
    later = added(counter, change)
    assert 0 <= later < SPAN
    assert apart(later, counter) == change
    assert float(later) == later


@given(periods, st.lists(st.integers(-(10**12), 10**12), max_size=30))
def test_what_is_charged_covers_what_is_given_out_and_hardly_more(
    period: float, given_out: list[int]
) -> None:
    scale = energy_scale(period)
    paid, prepaid, exact = 0, 0.0, Fraction(0)
    for wave in given_out:
        cost, prepaid = charged(scale * (1.0 * wave * wave), prepaid)
        assert cost >= 0
        assert 0.0 <= prepaid < 1.0
        paid += cost
        exact += Fraction(wave) ** 2 * EXACT_QUANTUM**2 / (2 * Fraction(period)) / EXACT_QUANTUM
        assert paid >= exact
        assert paid <= exact * (1 + Fraction(1, 2**47)) + 1


@given(periods, st.lists(waves, max_size=30))
def test_what_is_credited_was_paid_and_hardly_less(period: float, left: list[float]) -> None:
    credit, fraction, exact = 0, 0.0, Fraction(0)
    for wave in left:
        more, fraction = credited(0.5 * period * wave * wave / ENERGY_QUANTUM, fraction)
        assert more >= 0
        credit += more
        exact += Fraction(period) * Fraction(wave) ** 2 / 2 / EXACT_QUANTUM
        assert credit <= exact
        assert credit >= exact * (1 - Fraction(1, 2**47)) - 2


def test_at_energies_where_a_double_has_no_fraction_left_it_is_still_safe() -> None:
    """Near 2**51 quanta the five roundings are half a quantum: without the margin it fails."""
    rng = random.Random(1)
    period = 0.5e-3
    scale = energy_scale(period)
    for _ in range(500):
        wave = rng.randrange(10**12, 15 * 10**11)
        exact = Fraction(wave) ** 2 * EXACT_QUANTUM / (2 * Fraction(period))
        assert charged(scale * (1.0 * wave * wave), 0.0)[0] >= exact
        left = rng.uniform(1500.0, 2200.0)
        exact = Fraction(period) * Fraction(left) ** 2 / 2 / EXACT_QUANTUM
        assert credited(0.5 * period * left * left / ENERGY_QUANTUM, 0.0)[0] <= exact


@given(periods, st.lists(waves, max_size=200))
def test_an_integral_is_off_by_half_a_quantum_however_long(
    period: float, left: list[float]
) -> None:
    total, residue, exact = 0, 0.0, Fraction(0)
    for wave in left:
        change, residue = rounded_wave(wave, period, residue)
        total += change
        exact += Fraction(wave * period / WAVE_QUANTUM)
    # The one float that is carried rounds too: 2**-53 of a wave's quanta each time.
    assert abs(total - exact) <= Fraction(1, 2) + len(left) * Fraction(1, 2**10)


@pytest.mark.parametrize("period", [0.5e-3, 2e-3])
def test_a_wave_that_comes_in_time_costs_what_was_credited(period: float) -> None:
    """A million slots at one wave: the rounding of both sides does not drift apart."""
    scale = energy_scale(period)
    residue = fraction = prepaid = 0.0
    funds = 0
    lowest = 0
    for _ in range(20_000):
        change, residue = rounded_wave(1.2345678, period, residue)
        credit, fraction = credited(0.5 * period * 1.2345678**2 / ENERGY_QUANTUM, fraction)
        cost, prepaid = charged(scale * (1.0 * change * change), prepaid)
        funds += credit - cost
        lowest = min(lowest, funds)
    assert lowest > -10
    assert abs(funds) < 10
