"""Bounds of rational functions on an interval that are proved, not sampled.

Floats are binary fractions, so a polynomial with float coefficients is one with integers over a
power of two. Everything that decides is done with these integers: no rounding, no grid.

Sources: Vincent, Collins & Akritas (real roots by Descartes' rule and bisection, SYMSAC 1976);
Cargo & Shisha 1966 (Bernstein coefficients bound a polynomial); Schur 1918, Cohn 1922.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction

Whole = list[int]
"""Integer polynomial in t, constant first."""

DEPTH = 400
"""Bisections after which an interval has to be decided; doubles end at 1074."""


def common_integers(*parts: Sequence[float | Fraction]) -> list[list[int]]:
    """Return all the numbers times one common positive factor, as integers, exactly."""
    exact = [[Fraction(value) for value in part] for part in parts]
    scale = math.lcm(*(value.denominator for part in exact for value in part))
    return [[int(value * scale) for value in part] for part in exact]


def add_scaled(first: Whole, second: Whole, factor: int) -> Whole:
    """Return first + factor second."""
    length = max(len(first), len(second))
    padded = first + [0] * (length - len(first))
    for at, value in enumerate(second):
        padded[at] += factor * value
    return padded


def value_at(poly: Whole, t: Fraction) -> Fraction:
    """Return the value at t, exactly."""
    total = Fraction(0)
    for coefficient in reversed(poly):
        total = total * t + coefficient
    return total


def find_negative(poly: Whole) -> tuple[Fraction, Fraction] | None:
    """Return a subinterval of [0, 1] with an end where poly < 0, or None: poly >= 0 is proved.

    Each interval is decided by the signs of the Bernstein coefficients or by its ends, else
    halved. A polynomial that touches zero between ends is halved `DEPTH` times and then taken as
    negative: callers ask with a little slack.
    """
    work = [(list(poly), Fraction(0), Fraction(1))]
    while work:
        here, start, width = work.pop()
        if here[0] < 0 or sum(here) < 0:
            return start, start + width
        if all(value >= 0 for value in _bernstein(here)):
            continue
        if width.denominator.bit_length() > DEPTH:
            return start, start + width
        degree = len(here) - 1
        left = [value << (degree - at) for at, value in enumerate(here)]
        half = width / 2
        work.append((_shift(left), start + half, half))
        work.append((left, start, half))
    return None


def is_schur(denominator: Sequence[float | Fraction]) -> bool:
    """Return whether all roots lie strictly inside the unit circle, exactly (Schur, Cohn).

    `denominator` has its highest power first.
    """
    rest = [Fraction(value) for value in denominator]
    while len(rest) > 1 and rest[-1] == 0:
        rest.pop()
    while len(rest) > 1:
        reflection = rest[-1] / rest[0]
        if abs(reflection) >= 1:
            return False
        rest = [
            value - reflection * other for value, other in zip(rest, reversed(rest), strict=True)
        ][:-1]
    return True


def reduce_fraction(
    numerator: Sequence[float | Fraction], denominator: Sequence[float | Fraction]
) -> tuple[list[Fraction], list[Fraction]]:
    """Return numerator and denominator without their common factor; highest power first."""
    top = _trim([Fraction(value) for value in numerator])
    bottom = _trim([Fraction(value) for value in denominator])
    first, second = bottom, top
    while second != [0]:
        first, second = second, _divide(first, second)[1]
    if len(first) == 1:
        return top, bottom
    return _divide(top, first)[0], _divide(bottom, first)[0]


def _trim(poly: list[Fraction]) -> list[Fraction]:
    while len(poly) > 1 and poly[0] == 0:
        poly = poly[1:]
    return poly


def _divide(top: list[Fraction], bottom: list[Fraction]) -> tuple[list[Fraction], list[Fraction]]:
    """Return quotient and remainder."""
    if len(top) < len(bottom):
        return [Fraction(0)], top
    rest = list(top)
    quotient = []
    for at in range(len(top) - len(bottom) + 1):
        factor = rest[at] / bottom[0]
        quotient.append(factor)
        for offset, value in enumerate(bottom):
            rest[at + offset] -= factor * value
    left = rest[len(quotient) :]
    return quotient, _trim(left) if left else [Fraction(0)]


def _shift(poly: Whole) -> Whole:
    """Return the coefficients of poly(t + 1)."""
    out = list(poly)
    for first in range(len(out) - 1):
        for at in range(len(out) - 2, first - 1, -1):
            out[at] += out[at + 1]
    return out


def _bernstein(poly: Whole) -> Whole:
    """Return the Bernstein coefficients on [0, 1], each times its binomial."""
    return _shift(poly[::-1])
