"""The exact positive-real test: what must pass, what must fail, strictness, networks."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.exact.axis import passivity_margin
from tautwave.analysis.exact.positive_real import LOSSLESS, NOT, PLAIN, STRICT, WEAK, positive_real
from tautwave.analysis.exact.rational import Rational, S, constant, rational
from tests.analysis.reference.bilinear import substitute
from tests.analysis.reference.discrete import discrete_positive_real
from tests.examples import tried
from tests.lab.papers.resonator_loop import controller_impedance, device_admittance

PADE = rational(["-0.00025", 1], ["0.00025", 1])  # of half a sample at 1 ms
PASS = {
    "G": device_admittance(),
    "K0K": controller_impedance(),
    "lead": rational([1, 1], [1, 2]),
    "mass on spring": rational([1, 0], [1, 0, 1]),
    "touches zero": rational([1, 1, 1], [1, 1, 4]),
    "cancels to a spring": rational([1, 1000], [0.001, 1, 0]),
}
FAIL = {
    "double integrator": rational([1], [1, 0, 0]),
    "negative spring": rational([-1], [1, 0]),
    "unstable, phase within 90": rational([1, -1], [1, -2]),
    "crosses zero by 1e-12": rational([1, 1, 1], [1, 1, 4 + 1e-12]),
    "low pass": rational([1], [1, 1, 1]),
    "late damper": rational([0.5, 1000], [0.001, 1, 0]),
    "Pade of eq 9": controller_impedance() * PADE,
}


@pytest.mark.parametrize("name", PASS)
def test_D10_must_pass(name: str) -> None:
    found = positive_real(PASS[name])
    assert found.positive_real, found.reason
    assert positive_real(PASS[name].inverse()).positive_real
    assert passivity_margin(PASS[name]).margin_deg >= 0.0


@pytest.mark.parametrize("name", FAIL)
def test_D10_must_fail(name: str) -> None:
    found = positive_real(FAIL[name])
    assert not found.positive_real
    assert found.strictness == NOT
    assert not positive_real(FAIL[name].inverse()).positive_real


def test_reasons_name_the_place() -> None:
    assert positive_real(FAIL["unstable, phase within 90"]).unstable_poles == 1
    assert passivity_margin(FAIL["unstable, phase within 90"]).margin_deg > 70.0
    band = positive_real(FAIL["crosses zero by 1e-12"]).negative[0]
    assert band.low < math.sqrt(2) < band.high
    assert band.high - band.low == pytest.approx(7e-7, rel=0.05)
    assert passivity_margin(FAIL["crosses zero by 1e-12"]).margin_deg < 0.0
    assert "residue -1" in positive_real(FAIL["negative spring"]).reason
    assert "2-fold" in positive_real(rational([-1], [1, 0, 0])).reason
    touched = positive_real(PASS["touches zero"])
    assert touched.touches == pytest.approx([math.sqrt(2)])
    assert "above 1 rad/s" in positive_real(FAIL["low pass"]).reason
    integrator = positive_real(controller_impedance()).axis_poles[0]
    assert integrator.residue == pytest.approx(2476.7441860, rel=1e-9)


@pytest.mark.parametrize(
    ("function", "strictness"),
    [
        (device_admittance(), PLAIN),  # Re G(0) = 0
        (constant(1), STRICT),
        (rational([1], [1, 1]), STRICT),
        (rational([1, 1], [1]), STRICT),
        (rational([1, 1], [1, 2]), STRICT),
        (rational([1, 1], [1, 1, 1]), WEAK),  # w**2 Re -> 0
        (rational([1, 1, 1], [1, 1]), WEAK),  # its inverse
        (rational([1, 1], [1, 0]), PLAIN),
        (S, LOSSLESS),
        (rational([1, 0, 2, 0], [1, 0, 1]), LOSSLESS),  # s + s/(s^2 + 1)
        (rational([1, 0, 4, 0], [1, 0, 3, 0, 2]), NOT),  # zeros and poles do not alternate
    ],
)
def test_strictness(function: Rational, strictness: str) -> None:
    assert positive_real(function).strictness == strictness
    assert positive_real(function.inverse()).strictness == strictness


def test_strictly_means_shifted_left() -> None:
    shift = rational([1, "-0.0001"])
    for f in (rational([1], [1, 1]), rational([1, 1], [1, 2]), rational([1, 1], [1, 1, 1])):
        moved = substitute(f, shift)
        strict = positive_real(f).strictness == STRICT
        assert positive_real(moved).positive_real == strict


def test_discrete_functions_through_the_bilinear_map() -> None:
    assert discrete_positive_real(rational([1, 1], [1, -1])).strictness == LOSSLESS  # trapezoid
    assert not discrete_positive_real(rational([1], [1, -1])).positive_real  # Euler's integrator
    assert discrete_positive_real(rational([1, 0], [1, -1])).positive_real  # with today's sample
    assert not discrete_positive_real(rational([1], [1, 0])).positive_real  # a sample of delay
    found = discrete_positive_real(rational([2, -1], [1, -2]))
    assert "outside the unit circle" in found.reason
    late = discrete_positive_real(rational([2, 1], [2, 0]))  # 1 + z^-1/2
    assert late.positive_real
    edge = discrete_positive_real(rational([1, 2], [1, 0]))  # 1 + 2 z^-1: Re < 0 past 120 degrees
    assert edge.negative[0].low == pytest.approx(2.0 * math.pi / 3.0)


numbers = st.integers(1, 9)
terms = st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=3)


@pytest.mark.slow
@given(terms, st.integers(0, 3), st.integers(0, 3))
@settings(max_examples=60)
def test_sums_of_resonators_pass_and_with_less_damping_than_none_fail(
    modes: list[tuple[int, int, int]], direct: int, spring: int
) -> None:
    whole = constant(direct) + rational([spring], [1, 0])
    for m, b, k in modes:
        whole = whole + rational([1, 0], [m, b, k])
    assert positive_real(whole).positive_real
    assert passivity_margin(whole).margin_deg >= 0.0
    spoiled = whole - constant(direct) - "1/1000"  # Re < 0 at w = 0 or at infinity
    assert not positive_real(spoiled).positive_real
    assert passivity_margin(spoiled).margin_deg < 0.0


@given(st.lists(st.integers(-3, 5), min_size=2, max_size=4),
       st.lists(st.integers(-3, 5), min_size=2, max_size=4))  # fmt: skip
@settings(max_examples=tried(150))
def test_verdict_is_that_of_the_definition_on_random_functions(
    num: list[int], den: list[int]
) -> None:
    """PR: no pole right, no negative band, allowed axis poles. Three other exact counts."""
    if not any(den):
        return
    k = rational(num, den)
    found = positive_real(k)
    allowed = all(p.allowed for p in found.axis_poles)
    assert found.positive_real == (not found.unstable_poles and not found.negative and allowed)
