"""Waves between two rates: energy as a sum of squares, the integral exact, any phase and loss."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.conversion import gather_wave, hand_over
from tests.analysis.reference.conversion import hold_matrix, mean_magnitude, mean_matrix

sizes = st.integers(1, 50)
numbers = st.floats(-10.0, 10.0)


def squares(values: list[float]) -> float:
    return math.fsum(value * value for value in values)


def block_of(waves: list[float]) -> tuple[float, float]:
    """Return mean and what was lost of a block taken wave by wave; every loss is checked."""
    mean, lost = 0.0, 0.0
    for count, wave in enumerate(waves):
        mean, more = gather_wave(count, mean, wave)
        assert more >= 0.0
        lost += more
    return mean, lost


@given(sizes, st.data())
def test_a_block_loses_what_is_not_constant_in_it(size: int, data: st.DataObject) -> None:
    waves = data.draw(st.lists(numbers, min_size=0, max_size=size))  # begun late: fewer
    mean, lost = block_of(waves)
    slow, more = hand_over(size, len(waves), mean)
    assert more >= 0.0
    scale = squares(waves) + 1e-300
    assert size * slow * slow + lost + more == pytest.approx(squares(waves), abs=1e-12 * scale)
    total = math.fsum(waves)
    assert size * slow == pytest.approx(total, abs=1e-13 * (1.0 + sum(map(abs, waves))))


@given(sizes, numbers)
def test_a_constant_wave_passes_as_it_is(size: int, wave: float) -> None:
    mean, lost = block_of([wave] * size)
    assert (mean, lost) == (wave, 0.0)
    assert hand_over(size, size, mean) == (wave, 0.0)


@pytest.mark.parametrize("size", [1, 2, 10, 50])
def test_it_is_the_mean_and_hold_of_the_analysis(size: int) -> None:
    waves = np.random.default_rng(size).normal(size=size)
    mean, _ = block_of(waves.tolist())
    slow, _ = hand_over(size, size, mean)
    assert slow == pytest.approx((mean_matrix(size) @ waves)[0], rel=1e-12)
    assert (hold_matrix(size) @ [slow]).tolist() == [slow] * size


def test_theory_says_how_much_of_20_hertz_gets_through() -> None:
    angles = 2 * np.pi * 20.0 * 1e-3 * np.arange(100_000) + 0.3
    slow = [hand_over(10, 10, block_of(b)[0])[0] for b in np.cos(angles).reshape(-1, 10).tolist()]
    share = math.sqrt(2.0 * np.mean(np.square(slow)))
    assert share == pytest.approx(0.936105, rel=1e-5)
    assert share == pytest.approx(mean_magnitude(20.0, 10, 1e-3), rel=1e-5)


@given(
    sizes, sizes, st.integers(0, 49), st.integers(0, 49),
    st.lists(st.tuples(numbers, st.booleans()), min_size=1, max_size=250),
    st.lists(st.booleans(), min_size=60, max_size=60),
)  # fmt: skip
def test_a_chain_of_rates_never_gives_more_than_it_got(
    first: int,
    second: int,
    phase: int,
    shift: int,
    script: list[tuple[float, bool]],
    kept: list[bool],
) -> None:
    """Fast to slow, held, to another slow rate, held again: ratios, phases and losses at random.

    At every moment, not only at the end: what came out so far is no more than what went in.
    """
    blocks = [(0, 0.0), (0, 0.0)]
    held = [0.0, 0.0]
    income = given_out = integral_in = integral_out = 0.0
    handed = 0
    lossless = True
    for slot, (wave, arrives) in enumerate(script):
        wave = wave if arrives else 0.0
        income += wave * wave
        integral_in += wave
        for at, (size, offset) in enumerate(((first, phase), (second, shift))):
            count, mean = blocks[at]
            mean, _ = gather_wave(count, mean, wave)
            blocks[at] = (count + 1, mean)
            if (slot + offset) % size == size - 1:
                held[at], _ = hand_over(size, count + 1, mean)
                blocks[at] = (0, 0.0)
                if not kept[handed % len(kept)]:
                    held[at] = 0.0  # the slow side had no sample
                    lossless = False
                handed += 1
            wave = held[at]
        given_out += wave * wave
        integral_out += wave
        assert given_out <= income * (1.0 + 1e-12) + 1e-12
    if lossless:
        # What has not come out is under way: a block or a hold of either stage, no more.
        largest = max((abs(wave) for wave, _ in script), default=0.0)
        assert abs(integral_in - integral_out) <= 2.0 * (first + second) * largest + 1e-9


def test_picking_instead_of_averaging_is_caught() -> None:
    """The counterexample: every n-th wave, worth n periods, carries up to n times the energy."""
    waves = [0.0] * 9 + [1.0]
    assert 10 * waves[-1] ** 2 == 10.0 * squares(waves)
    mean, lost = block_of(waves)
    assert 10 * mean * mean + lost == pytest.approx(squares(waves))
    # And holding with 1/sqrt(n), as for samples worth one period each, loses the integral.
    assert 10 * (mean / math.sqrt(10.0)) != pytest.approx(sum(waves), rel=0.5)
