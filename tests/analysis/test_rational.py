"""Exact polynomials and rational functions, the phase test and loops, against NumPy and SciPy."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.axis import passivity_margin
from tautwave.analysis.exact.delay_roots import DelayLoop, rightmost_roots
from tautwave.analysis.exact.rational import Delayed, Rational, S, Sampled, rational
from tautwave.errors import ConfigError
from tests.analysis.reference.bilinear import bilinear
from tests.analysis.reference.curves import curve, response
from tests.analysis.reference.delay_loops import unstable_count
from tests.analysis.reference.gains import stable_gains, unconditionally_stable
from tests.analysis.reference.passivity_scan import scan_passivity
from tests.lab.papers.loops import modulus_margin, revised_bode

coefficients = st.lists(st.integers(-4, 4), min_size=2, max_size=7).filter(lambda c: c[0] != 0)


@given(coefficients, st.sampled_from([(1,), (1, 0, 2), (1, 0, -3), (1, 0), (1, 0, 0, 0, 4)]))
def test_half_planes_are_those_of_the_roots(first: list[int], symmetric: tuple[int, ...]) -> None:
    p = poly.multiply(poly.polynomial(first), poly.polynomial(symmetric))
    real = np.roots([float(c) for c in p]).real
    if np.any((np.abs(real) > 1e-9) & (np.abs(real) < 2e-3)):
        return  # a multiple root that NumPy cannot place: ours is the exact one
    counted = poly.half_planes(p)
    assert counted == (np.sum(real < -1e-6), np.sum(np.abs(real) <= 1e-6), np.sum(real > 1e-6))


@given(st.lists(st.fractions(Fraction(1, 50), 50, max_denominator=60), min_size=1, max_size=5))
def test_positive_roots_are_found_with_their_multiplicity(roots: list[Fraction]) -> None:
    p = poly.polynomial([1, 0, 3])
    for root in roots:
        p = poly.multiply(p, poly.multiply((Fraction(1), -root), (Fraction(1), root)))
    found = poly.positive_roots(p)
    assert [(r.value, r.multiplicity) for r in found] == [
        (pytest.approx(float(x), rel=1e-14), roots.count(x)) for x in sorted(set(roots))
    ]


def test_close_roots_are_distinguished_and_irrational_ones_found() -> None:
    p = poly.multiply(poly.polynomial([1, 0, -2]), poly.polynomial([1, "-1.41421356237"]))
    close = [r.value for r in poly.positive_roots(p)]
    assert close == [pytest.approx(1.41421356237, abs=1e-15), pytest.approx(math.sqrt(2))]
    assert poly.count_roots(p) == 3


def test_floats_are_read_as_they_print_and_common_factors_go() -> None:
    assert rational([0.001, 1.0], [0.1]) == rational(["1/100", 10])
    assert rational([1, 3, 2], [1, 1]) == rational([1, 2])
    assert (S + 1) * (S - 1) / (S + 1) == S - 1
    with pytest.raises(ConfigError, match="differ from zero"):
        rational([1], [0])
    with pytest.raises(ConfigError, match="finite"):
        rational([math.nan], [1])


@pytest.mark.parametrize("number", [2, Fraction(2), np.int64(2), np.float64(2.0), 2.0])
def test_numbers_may_stand_on_either_side(number: Fraction) -> None:
    f = rational([1, 3], [1, 5, 7])
    two = rational([2])
    assert number + f == f + number == two + f
    assert number - f == two - f == -(f - number)
    assert number * f == f * number == two * f
    assert number / f == two / f
    assert f / number == f / two
    assert (number * S) * 2**70 == rational([2**71, 0])  # beyond 64 bits
    assert number * S * S + Fraction(1, 3) / (1 - S) == rational([-6, 6, 0, 1], [-3, 3])


@pytest.mark.parametrize("other", [None, [1, 2], 1j])
def test_what_is_no_number_is_refused_by_name(other: object) -> None:
    for compute in (lambda: S + other, lambda: other - S, lambda: S * other, lambda: other / S):
        with pytest.raises(TypeError, match=r"unsupported operand|can't multiply"):
            compute()


@pytest.mark.parametrize(
    "function",
    [
        rational([1, 2, 3], [1, 0.5, 4, 7]),
        Delayed(rational([1, 2], [1, 5, 6]), 0.3, rational([1, 1])),
        Sampled(rational([5, 1], [1, -0.5]), 0.2, 0.05, (0.1, 0.2, 3.0)),
    ],
)
def test_slope_and_array_agree_with_the_value(function: Rational | Delayed | Sampled) -> None:
    s, h = 0.3 + 2.0j, 1e-5
    assert function.slope(s) == pytest.approx((function(s + h) - function(s - h)) / (2 * h), 1e-7)
    assert function.at(np.array([s]))[0] == pytest.approx(function(s), rel=1e-12)


def test_bilinear_and_response_agree_with_scipy() -> None:
    num, den = [1.0, 2.0, 3.0], [1.0, 0.4, 4.0, 7.0]
    f = rational(num, den)
    hz = np.array([0.01, 0.1, 1.0, 3.0])
    _, expected = signal.freqs(num, den, 2 * math.pi * hz)
    got = response(f, hz)
    np.testing.assert_allclose(got.real + 1j * got.imag, expected, rtol=1e-12)
    b, a = signal.bilinear(num, den, fs=0.5)  # 2 fs (z - 1)/(z + 1): (s-1)/(s+1) at s = z
    back = bilinear(rational(b.tolist(), a.tolist()))
    np.testing.assert_allclose(back.at(1j * hz), f.at(1j * hz), rtol=1e-10)
    assert curve(f, 0.01, 3.0).passive.dtype == bool


def test_phase_margin_is_exact_where_a_grid_is_coarse() -> None:
    found = passivity_margin(rational([1, 2], [1, 1, 1]))
    w = np.geomspace(1e-3, 1e3, 200_001)
    phase = np.abs(np.degrees(np.angle(rational([1, 2], [1, 1, 1]).at(1j * w))))
    assert -found.margin_deg == pytest.approx(phase.max() - 90.0, abs=1e-6)
    assert found.frequency == pytest.approx(w[phase.argmax()], rel=1e-3)
    assert found.negative == (pytest.approx((math.sqrt(2), math.inf)),)
    assert found.resistance == pytest.approx(-0.1547005383)
    # a notch of 1e-6 rad/s in which the phase turns round: no grid sees it
    narrow = rational([1, 1e-9, 1.0], [1, 1e-6, 1.0])
    assert passivity_margin(narrow).margin_deg == pytest.approx(90 - 87.13, abs=1.5)


def test_phase_with_delay_in_a_band() -> None:
    late = Delayed(rational([1000], [1, 0]), 0.001)  # a spring, 1 ms late
    found = scan_passivity(late, 1.0, 2.0e4)
    edges = [b for band in found.negative for b in band]
    expected = [1.0, 1000 * math.pi, 2000 * math.pi, 3000 * math.pi, 4000 * math.pi]
    assert edges == pytest.approx([*expected, 5000 * math.pi, 6000 * math.pi, 2e4][: len(edges)])
    assert found.margin_deg == pytest.approx(-90.0)
    assert found.frequency == pytest.approx(500 * math.pi)
    assert found.resistance == pytest.approx(-1.0, rel=1e-6)
    with pytest.raises(ConfigError, match="turns"):
        scan_passivity(late, 1.0, 1e12)


def test_revised_bode_suffices_and_is_not_needed() -> None:
    loop = rational([1, 2, 1], [1, 0, 0, 0])
    found = revised_bode(loop)
    assert not found.sufficient
    assert found.stable
    assert found.candidates == ((1.0, -2.0),)
    assert stable_gains(loop) == ((0.5, math.inf),)
    assert not revised_bode(loop * "1/4").stable
    slow = rational([1], [1, 3, 3, 1])
    assert stable_gains(slow) == (pytest.approx((0.0, 8.0)),)
    assert revised_bode(slow).sufficient
    assert not unconditionally_stable(slow)
    assert unconditionally_stable(rational([1], [1, 1]))


@pytest.mark.parametrize(
    ("num", "den"), [([1], [1, 0, 0, 0]), ([-1], [1, 0]), ([3], [1, -2]), ([1], [1, 0, 0])]
)
def test_criterion_does_not_overlook_axis_poles(num: list[int], den: list[int]) -> None:
    found = revised_bode(rational(num, den))
    assert not found.sufficient
    assert found.stable == (num == [3])


@pytest.mark.slow
@given(
    st.lists(st.floats(0.1, 5.0), min_size=1, max_size=3),
    st.floats(0.1, 20.0),
    st.floats(0.01, 2.0),
)
@settings(max_examples=30)
def test_argument_and_chebyshev_count_the_same(
    corners: list[float], gain: float, delay: float
) -> None:
    den = rational([1])
    for corner in corners:
        den = den * (S + round(corner, 3))
    loop = DelayLoop(den.num, poly.polynomial([round(gain, 3)]), delay)
    roots = rightmost_roots(loop, 12, nodes=40)
    if np.any(np.abs(roots.real) < 1e-3):
        return
    right = roots[roots.real > 0]
    assert unstable_count(loop) == np.sum(right.imag > 0) * 2 + np.sum(right.imag == 0)
    for root in roots[:3]:
        assert abs(loop(complex(root))) < 1e-8 * max(1.0, abs(root)) ** len(corners) * 20


@pytest.mark.parametrize(
    ("now", "late", "delay", "where"),
    [
        ([1, 2, -3], [3], 0.1, "at s = 0"),
        ([1, 1, 0], [1, 0], 0.5, "at s = 0"),
        ([1, 0], [], 0.2, "at s = 0"),
        ([1, 0], [], 0.0, "at s = 0"),
        ([1, 0, 4], [], 0.0, "away from s = 0"),
        ([1], [-1], 0.0, "zero everywhere"),
    ],
)
def test_a_root_on_the_axis_is_reported_without_a_warning(
    now: list[int], late: list[int], delay: float, where: str
) -> None:
    with pytest.raises(ConfigError, match=where):
        unstable_count(DelayLoop(poly.polynomial(now), poly.polynomial(late), delay))


def test_without_a_delay_the_late_part_may_be_of_any_order() -> None:
    """(s - 1)(s - 2), split so that the late part is of the higher order."""
    assert unstable_count(DelayLoop(poly.polynomial([-3, 2]), poly.polynomial([1, 0, 0]), 0.0)) == 2


def test_modulus_margin_is_least_on_a_grid() -> None:
    for loop in (rational([2, 1], [1, 1, 1, 0]), rational([4], [1, 3, 3, 1])):
        w = np.geomspace(1e-3, 1e3, 400_001)
        found = modulus_margin(loop)
        assert found.margin == pytest.approx(np.abs(1 + loop.at(1j * w)).min(), rel=1e-6)
    late = Delayed(rational([4], [1, 3, 3, 1]), 0.05)
    expected = np.abs(1 + late.at(1j * w)).min()
    assert modulus_margin(late, 1e-3, 1e3).margin == pytest.approx(expected, rel=1e-6)
