"""Polynomials with exact coefficients: real roots, and roots by half-plane, without rounding.

A polynomial is a tuple of `Fraction`, highest power first as NumPy and SciPy write them; the empty
tuple is zero. Units are those of the coefficients, SI throughout. Signs come from integer
arithmetic, so a double root that only touches zero is distinguished from two roots 1e-12 apart.

Sources: Sturm's chain and Yun's square-free factors as in Knuth, TAOCP vol. 2, 4.6.1-2; Routh's
array as the Sturm chain of p(jw): Gantmacher, Theory of Matrices vol. 2, ch. XV.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Sequence
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from tautwave.errors import ConfigError

Poly = tuple[Fraction, ...]
Number = int | float | str | numbers.Rational
_BITS = 54  # width of an isolating interval relative to the root: a double holds no more


class Root(NamedTuple):
    """One real root in (low, high] (or low = high: that number), and how often it is one."""

    low: Fraction
    high: Fraction
    multiplicity: int

    @property
    def value(self) -> float:
        """The root, to double precision."""
        return float(self.high)


class HalfPlanes(NamedTuple):
    """Roots with negative, zero and positive real part, each with its multiplicity."""

    left: int
    axis: int
    right: int


def exact(value: Number) -> Fraction:
    """Return a number exactly; a float means the decimal it prints as, so 0.001 is 1/1000.

    Raises
    ------
    ConfigError
        If it is not finite.
    """
    if isinstance(value, float):
        if not math.isfinite(value):
            raise ConfigError(f"a coefficient has to be finite (got {value})")
        return Fraction(repr(float(value)))
    if isinstance(value, numbers.Rational):
        return Fraction(int(value.numerator), int(value.denominator))  # a NumPy integer overflows
    return Fraction(value)


def polynomial(coefficients: Sequence[Number]) -> Poly:
    """Return the polynomial of `coefficients`, highest power first, without leading zeros."""
    return trim([exact(c) for c in coefficients])


def trim(p: Sequence[Fraction]) -> Poly:
    """Return `p` without leading zeros."""
    at = next((i for i, c in enumerate(p) if c), len(p))
    return tuple(p[at:])


def add(p: Poly, q: Poly) -> Poly:
    """Return p + q."""
    size = max(len(p), len(q))
    zero = Fraction(0)
    return trim(
        [
            a + b
            for a, b in zip(
                (zero,) * (size - len(p)) + p, (zero,) * (size - len(q)) + q, strict=True
            )
        ]
    )


def scale(p: Poly, factor: Fraction | int) -> Poly:
    """Return factor * p."""
    return tuple(c * factor for c in p) if factor else ()


def multiply(p: Poly, q: Poly) -> Poly:
    """Return p * q."""
    if not p or not q:
        return ()
    out = [Fraction(0)] * (len(p) + len(q) - 1)
    for i, a in enumerate(p):
        if a:
            for j, b in enumerate(q):
                out[i + j] += a * b
    return tuple(out)


def divide(p: Poly, q: Poly) -> tuple[Poly, Poly]:
    """Return quotient and remainder of p by q (not zero)."""
    rest = list(p)
    out = []
    for at in range(len(p) - len(q) + 1):
        factor = rest[at] / q[0]
        out.append(factor)
        if factor:
            for j, b in enumerate(q):
                rest[at + j] -= factor * b
    return trim(out), trim(rest[max(0, len(p) - len(q) + 1) :])


def derivative(p: Poly) -> Poly:
    """Return dp/ds."""
    n = len(p) - 1
    return tuple(c * (n - i) for i, c in enumerate(p[:-1]))


def evaluate(p: Poly, at: Fraction) -> Fraction:
    """Return p(at), exactly."""
    out = Fraction(0)
    for c in p:
        out = out * at + c
    return out


def gcd(p: Poly, q: Poly) -> Poly:
    """Return the monic greatest common divisor; of two zeros: zero."""
    a, b = _primitive(p), _primitive(q)
    while b:
        a, b = b, _remainder(a, b)
    return tuple(Fraction(c, a[0]) for c in a)


def mirrored(p: Poly) -> Poly:
    """Return p(-s)."""
    n = len(p) - 1
    return tuple(-c if (n - i) % 2 else c for i, c in enumerate(p))


def even_odd(p: Poly) -> tuple[Poly, Poly]:
    """Return (e, o), polynomials in x = w**2, with p(jw) = e(x) + j w o(x)."""
    n = len(p) - 1
    parts: tuple[list[Fraction], list[Fraction]] = ([], [])
    for i, c in enumerate(p):
        half, odd = divmod(n - i, 2)
        parts[odd].append(-c if half % 2 else c)
    return trim(parts[0]), trim(parts[1])


def square_free(p: Poly) -> list[tuple[Poly, int]]:
    """Return (factor, multiplicity) pairs with p = lead * product of factor**multiplicity (Yun)."""
    factors: list[tuple[Poly, int]] = []
    slope = derivative(p)
    common = gcd(p, slope)
    rest, other = divide(p, common)[0], divide(slope, common)[0]
    multiplicity = 1
    while len(rest) > 1:
        difference = add(other, scale(derivative(rest), -1))
        factor = gcd(rest, difference)
        if len(factor) > 1:
            factors.append((factor, multiplicity))
        rest, other = divide(rest, factor)[0], divide(difference, factor)[0]
        multiplicity += 1
    return factors


def count_roots(p: Poly, low: Fraction | None = None, high: Fraction | None = None) -> int:
    """Return how many different real roots p has in (low, high]; None: no end there (Sturm)."""
    chain = _chain(_primitive(p), _primitive(derivative(p)))
    return _variations(chain, low, -1) - _variations(chain, high, 1)


def positive_roots(p: Poly) -> list[Root]:
    """Return the roots of p in (0, inf), rising, isolated exactly and narrowed to a double.

    Source: bisection on Sturm's chain of the square-free part.
    """
    while p and not p[-1]:
        p = p[:-1]
    if len(p) < 2:
        return []
    factors = square_free(p)
    free: Poly = (Fraction(1),)
    for factor, _ in factors:
        free = multiply(free, factor)
    chain = _chain(_primitive(free), _primitive(derivative(free)))
    largest = 1 + max(abs(c / free[0]) for c in free)
    smallest = 1 / (1 + max(abs(c / free[-1]) for c in free))
    waiting = [(smallest / 2, largest)]
    roots = []
    while waiting:
        low, high = waiting.pop()
        count = _variations(chain, low, -1) - _variations(chain, high, 1)
        if count == 1:
            low, high = _narrow(chain[0], low, high)
            roots.append(Root(low, high, _multiplicity(factors, low, high)))
        elif count > 1:
            middle = _middle(low, high)
            waiting += [(middle, high), (low, middle)]
    return sorted(roots)


def half_planes(p: Poly) -> HalfPlanes:
    """Return how many roots p (not zero) has left of, on and right of the imaginary axis.

    Routh's count, with every singular case: what p(jw) and its conjugate share is split off first.
    """
    n = len(p) - 1
    even, odd = even_odd(p)
    real = _in_w(even, 0)  # p(jw) = real(w) + j imag(w)
    imag = _in_w(odd, 1)
    common = gcd(real, imag)
    axis = sum(count_roots(f) * m for f, m in square_free(common)) if len(common) > 1 else 0
    pairs = len(common) - 1 - axis  # symmetric about the axis: half of them on either side
    real, imag = divide(real, common)[0], divide(imag, common)[0]
    rest = n - (len(common) - 1)
    first, second = (real, imag) if len(real) > len(imag) else (imag, scale(real, -1))
    chain = _chain(_primitive(first), _primitive(second))
    turns = -(_variations(chain, None, -1) - _variations(chain, None, 1))  # arg gained, in pi
    left = (rest + turns) // 2
    return HalfPlanes(left + pairs // 2, axis, rest - left + pairs // 2)


def is_hurwitz(p: Poly) -> bool:
    """Return whether every root of p has a negative real part (Routh, exactly)."""
    return bool(p) and half_planes(p).left == len(p) - 1


# -- integers ------------------------------------------------------------------------------------


def _in_w(p: Poly, shift: int) -> Poly:
    """Return w**shift * p(w**2)."""
    out: list[Fraction] = []
    for c in p:
        out += [c, Fraction(0)]
    return tuple(out[:-1]) + (Fraction(0),) * shift if p else ()


def _primitive(p: Poly) -> list[int]:
    """Return a positive multiple of p with small whole coefficients."""
    common = math.lcm(*(c.denominator for c in p)) if p else 1
    return _reduced([c.numerator * (common // c.denominator) for c in p])


def _reduced(p: list[int]) -> list[int]:
    at = next((i for i, c in enumerate(p) if c), len(p))
    p = p[at:]
    content = math.gcd(*p) if p else 1
    return [c // content for c in p]


def _remainder(p: list[int], q: list[int]) -> list[int]:
    """Return a positive multiple of p mod q."""
    rest = list(p)
    lead = abs(q[0])
    while len(rest) >= len(q):
        factor = rest[0] if q[0] > 0 else -rest[0]
        rest = [lead * c for c in rest]
        for j, b in enumerate(q):
            rest[j] -= factor * b
        rest = rest[1:] if any(rest) else []
    return _reduced(rest)


def _chain(p: list[int], q: list[int]) -> list[list[int]]:
    chain = [p]
    while q:
        chain.append(q)
        q = [-c for c in _remainder(chain[-2], q)]
    return chain


def _sign(p: list[int], at: Fraction) -> int:
    top, bottom = at.numerator, at.denominator
    out, weight = 0, 1
    for c in p:
        out = out * top + c * weight
        weight *= bottom
    return (out > 0) - (out < 0)


def _variations(chain: list[list[int]], at: Fraction | None, side: int) -> int:
    """Return the sign changes along the chain at a point, or at infinity on one side."""
    if at is None:
        signs = [(1 if p[0] > 0 else -1) * side ** (len(p) - 1) for p in chain]
    else:
        signs = [s for s in (_sign(p, at) for p in chain) if s]
    return sum(a != b for a, b in pairwise(signs))


def _middle(low: Fraction, high: Fraction) -> Fraction:
    """Return a short number between: the geometric middle while the ends are far apart."""
    if high > 2 * low:
        bits = [x.numerator.bit_length() - x.denominator.bit_length() for x in (low, high)]
        guess = Fraction(2) ** ((bits[0] + bits[1]) // 2)
        if low < guess < high:
            return guess
    return (low + high) / 2


def _narrow(p: list[int], low: Fraction, high: Fraction) -> tuple[Fraction, Fraction]:
    """Bisect the only root in (low, high] to double precision."""
    after = _sign(p, high)
    if not after:
        return high, high
    while (high - low) * 2**_BITS > high:
        middle = _middle(low, high)
        sign = _sign(p, middle)
        if not sign:
            return middle, middle
        low, high = (low, middle) if sign == after else (middle, high)
    return low, high


def _multiplicity(factors: list[tuple[Poly, int]], low: Fraction, high: Fraction) -> int:
    if len(factors) == 1:
        return factors[0][1]
    for factor, multiplicity in factors:
        hit = not evaluate(factor, high) if low == high else bool(count_roots(factor, low, high))
        if hit:
            return multiplicity
    return 1
