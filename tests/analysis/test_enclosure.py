"""Enclosures over cells hold what they enclose, and the test of roots counts them."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.wave_port.enclosure import Enclosed, angle, cosine_sums, sine_ratio
from tautwave.analysis.wave_port.reflection import _inside
from tests.examples import tried


@settings(deadline=None, max_examples=tried(60))
@given(st.lists(st.integers(-9, 9), min_size=1, max_size=6))
def test_schurs_test_counts_roots(coefficients: list[int]) -> None:
    if coefficients[0] == 0:
        coefficients[0] = 1
    a = [Fraction(each) for each in coefficients]
    roots = np.abs(np.roots(coefficients))
    if roots.size == 0 or np.all(np.abs(roots - 1.0) > 1e-6):
        assert _inside(a) == bool(np.all(roots < 1.0))


CELLS = st.tuples(st.floats(0.0, 3.1), st.floats(1e-4, 1.5), st.floats(-1.0, 1.0))
SUMS = st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=6)


def inside(found: Enclosed, at: float, true: float) -> bool:
    """Return whether a truth at `at` from the centre is where an enclosure says."""
    value = found.value[0] + found.slope[0] * at
    slack = found.rest[0] + 1e-15 * (abs(found.value[0]) + abs(true))
    return abs(true - value) <= slack and found.least[0] <= true <= found.most[0]


@settings(deadline=None, max_examples=tried(300))
@given(CELLS, SUMS, SUMS)
def test_enclosures_hold_what_they_enclose(cell: tuple, a: list, b: list) -> None:
    centre, half, share = cell
    at = share * half
    theta = centre + at

    def true(c: list) -> float:
        return math.fsum(x * math.cos(k * theta) for k, x in enumerate(c))

    here, width = np.array([centre]), np.array([half])
    first, second = (cosine_sums(np.array([c]), here, width)[0] for c in (a, b))
    assert inside(first, at, true(a))
    assert inside(first * second, at, true(a) * true(b))
    assert inside(first - 2.0 * second, at, true(a) - 2.0 * true(b))
    assert inside(first + 1.0, at, true(a) + 1.0)
    inverse = (second * second + 0.5).inverse()
    if np.isfinite(inverse.rest[0]):  # over a wide cell nothing may be known
        assert inside(first * inverse, at, true(a) / (true(b) ** 2 + 0.5))
    assert inside(sine_ratio(here, width), at, float(np.sinc(theta / math.pi)))
    assert inside(angle(here, width), at, theta)


def test_the_order_that_is_only_bounded_counts() -> None:
    """15 cos t - 6 cos 2t + cos 3t is flat up to the fifth order at 0, and not beyond."""
    rows = np.array([[0.0, 15.0, -6.0, 1.0], [1.0, 0.0, 0.0, 0.0]])
    found, _ = cosine_sums(rows, np.zeros(1), np.array([0.5]))
    assert inside(found, 0.5, 15.0 * math.cos(0.5) - 6.0 * math.cos(1.0) + math.cos(1.5))


def test_at_points_the_same_operations_give_the_values_themselves() -> None:
    """What is computed at points is what an enclosure of no width has for its value."""
    theta, rows = np.linspace(0.02, 3.1, 9), np.array([[0.3, -1.2, 0.5], [2.0, 0.4, -0.1]])

    def found(half: np.ndarray | None) -> Enclosed:
        one, other = cosine_sums(rows, theta, half)
        u = one * angle(theta, half) - other * 0.5 + sine_ratio(theta, half)
        return (2.0 * u * (other * other + 0.1).inverse()).but(theta < 0.1, np.zeros(9))

    exact, points = found(np.zeros(9)), found(None)
    assert np.allclose(points.value, exact.value, rtol=1e-13, atol=0.0)
    assert np.array_equal(points.least, points.value)
    assert np.array_equal(points.most, points.value)
    assert np.allclose(points.size, np.abs(exact.value), rtol=1e-13)
