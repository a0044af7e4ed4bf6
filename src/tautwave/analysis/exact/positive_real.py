"""Exact test for positive realness of rational functions, and what is wrong where it fails.

K = N/D (no common factor) is positive real if and only if
  (i)  N + D has all its roots in the open left half-plane and the degree of the larger of both,
  (ii) A(x) = Re N(jw) D(-jw), x = w**2, is >= 0 for every x >= 0.
Together they say that (K - 1)/(K + 1) is bounded real, which covers poles on the axis and their
residues too. Both are decided in whole numbers (Routh, Sturm): a grid over frequencies takes
(s^2+s+1)/(s^2+s+4+1e-12) for passive, a look at the phase alone (s-1)/(s-2).

Sources: Brune 1931; Anderson & Vongpanitlerd, Network Analysis and Synthesis, 1973, ch. 2 and 5;
strictness: Ioannou & Tao, IEEE T-AC 32(1) 1987, 53-54. Frequencies in rad/s.
"""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise
from typing import NamedTuple

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.polynomials import Poly, Root
from tautwave.analysis.exact.rational import Rational

NOT = "not positive real"
LOSSLESS = "lossless positive real"
PLAIN = "positive real"
WEAK = "weakly strictly positive real"
STRICT = "strictly positive real"


class Band(NamedTuple):
    """An open interval of frequencies (low, high) [rad/s]."""

    low: float
    high: float


class AxisPole(NamedTuple):
    """A pole at +-j frequency [rad/s], or at infinity, with its multiplicity and residue.

    The residue of a multiple pole is the coefficient of its highest power. Positive realness wants
    multiplicity 1 and a residue that is real and positive.
    """

    frequency: float
    multiplicity: int
    residue: complex

    @property
    def allowed(self) -> bool:
        """Whether a positive-real function may have it; the residue is a rounded number."""
        small = 1e-9 * abs(self.residue)
        return self.multiplicity == 1 and abs(self.residue.imag) <= small < self.residue.real


class PositiveReal(NamedTuple):
    """Result of `positive_real`.

    positive_real : the verdict. strictness : one of the five levels of this module.
    unstable_poles : poles with positive real part. axis_poles : those on the axis and at infinity.
    negative : bands in which Re K(jw) < 0. touches : frequencies (0 and inf too) at which Re K, or
    its leading term, vanishes without a change of sign; empty if it is zero throughout.
    reason : one sentence.
    """

    positive_real: bool
    strictness: str
    unstable_poles: int
    axis_poles: tuple[AxisPole, ...]
    negative: tuple[Band, ...]
    touches: tuple[float, ...]
    reason: str


def resistance(k: Rational) -> tuple[Poly, Poly]:
    """Return (top, bottom) without common factors: Re K(jw) = top(x) / bottom(x) at x = w**2.

    bottom >= 0 for every x >= 0, and top/bottom has a pole only where Re K itself has one.
    """
    top = poly.even_odd(poly.multiply(k.num, poly.mirrored(k.den)))[0]
    if not top:
        return (), (Fraction(1),)
    bottom = poly.even_odd(poly.multiply(k.den, poly.mirrored(k.den)))[0]
    common = poly.gcd(top, bottom)
    if len(common) > 1:
        top, bottom = poly.divide(top, common)[0], poly.divide(bottom, common)[0]
    sign = 1 if poly.evaluate(bottom, between(*_last_gap(bottom))) > 0 else -1
    return poly.scale(top, sign), poly.scale(bottom, sign)


def positive_real(k: Rational) -> PositiveReal:
    """Decide whether K is positive real, exactly, and say where it fails.

    Parameters
    ----------
    k : Rational
        Impedance or admittance; K is positive real if and only if 1/K is.
    """
    top, bottom = resistance(k)
    roots = poly.positive_roots(top)
    negative = tuple(Band(low.value, high.value) for low, high in negative_intervals(top, roots))
    total = poly.add(k.num, k.den)
    degree = max(len(k.num), len(k.den))
    verdict = len(total) == degree and poly.is_hurwitz(total) and not negative
    unstable = poly.half_planes(k.den).right
    axis = axis_poles(k)
    touches = _touches(k, top, bottom, roots)
    strictness = _strictness(top, touches, axis) if verdict else NOT
    decision = PositiveReal(verdict, strictness, unstable, axis, negative, touches, "")
    return decision._replace(reason=_praise(decision) if verdict else _reason(decision))


class Edge(NamedTuple):
    """An end of an interval in x = w**2: a root, zero or infinity, with exact bounds."""

    low: Fraction | None
    high: Fraction | None

    @property
    def value(self) -> float:
        """The frequency w [rad/s]."""
        return math.inf if self.high is None else math.sqrt(float(self.high))


def negative_intervals(top: Poly, roots: list[Root] | None = None) -> list[tuple[Edge, Edge]]:
    """Return the intervals of x > 0 in which top(x) < 0, exactly bounded; see `resistance`."""
    if not top:
        return []
    roots = poly.positive_roots(top) if roots is None else roots
    intervals: list[tuple[Edge, Edge]] = []
    for low, high in pairwise(_edges(roots)):
        if poly.evaluate(top, between(low, high)) < 0:
            if intervals and _is_even(roots, low):
                low = intervals.pop()[0]
            intervals.append((low, high))
    return intervals


def between(low: Edge, high: Edge) -> Fraction:
    """Return a short number x between two edges."""
    start = low.high or Fraction(0)
    if high.low is None:
        return 2 * start + 1
    middle = (start + high.low) / 2
    short = Fraction(float(middle))
    return short if start < short < high.low else middle


def axis_poles(k: Rational) -> tuple[AxisPole, ...]:
    """Return the poles of K on the imaginary axis, rising, then the one at infinity if any."""
    poles = []
    for w, multiplicity in axis_roots(k.den):
        s = 1j * w
        poles.append(
            AxisPole(w, multiplicity, leading(k.num, s, 0) / leading(k.den, s, multiplicity))
        )
    if k.relative_degree < 0:
        poles.append(AxisPole(math.inf, -k.relative_degree, complex(k.num[0] / k.den[0])))
    return tuple(poles)


def axis_roots(p: Poly) -> list[tuple[float, int]]:
    """Return (w, multiplicity) of the roots +-jw of p, w >= 0 rising; found exactly."""
    rest = p
    while rest and not rest[-1]:
        rest = rest[:-1]
    at_zero = len(p) - len(rest)
    even, odd = poly.even_odd(rest)
    common = poly.gcd(even, odd)
    roots = [(math.sqrt(r.value), r.multiplicity) for r in poly.positive_roots(common)]
    return ([(0.0, at_zero)] if at_zero else []) + roots


def leading(p: Poly, s: complex, multiplicity: int) -> complex:
    """Return the factor c of p ~ c (s' - s)**multiplicity near a root s of that multiplicity."""
    for _ in range(multiplicity):
        p = poly.derivative(p)
    out = 0j
    for c in p:
        out = out * s + float(c)
    return out / math.factorial(multiplicity)


# -- verdict -------------------------------------------------------------------------------------


def _edges(roots: list[Root]) -> list[Edge]:
    inner = [Edge(r.low, r.high) for r in roots]
    return [Edge(Fraction(0), Fraction(0)), *inner, Edge(None, None)]


def _is_even(roots: list[Root], edge: Edge) -> bool:
    return any(r.high == edge.high and not r.multiplicity % 2 for r in roots)


def _last_gap(p: Poly) -> tuple[Edge, Edge]:
    last, end = _edges(poly.positive_roots(p))[-2:]
    return last, end


def _touches(k: Rational, top: Poly, bottom: Poly, roots: list[Root]) -> tuple[float, ...]:
    if not top:
        return ()
    touches = [math.sqrt(r.value) for r in roots if not r.multiplicity % 2]
    if not top[-1]:
        touches.insert(0, 0.0)
    # Slower than Re K may vanish at infinity: w**-2 below a simple zero, not at all below a pole.
    if len(bottom) - len(top) > (k.relative_degree == 1):
        touches.append(math.inf)
    return tuple(touches)


def _strictness(top: Poly, touches: tuple[float, ...], axis: tuple[AxisPole, ...]) -> str:
    if not top:
        return LOSSLESS
    if (axis and axis[0].frequency < math.inf) or (touches and touches[0] < math.inf):
        return PLAIN
    return WEAK if touches else STRICT


def _reason(found: PositiveReal) -> str:
    if found.unstable_poles:
        count = found.unstable_poles
        verb = "lies" if count == 1 else "lie"
        return f"{count} of its poles {verb} in the right half-plane: it is unstable by itself"
    if found.negative:
        bands = [_words(band) for band in found.negative]
        return f"Re K(jw) < 0 for w {bands[0]}" + "".join(f", {b}" for b in bands[1:])
    for pole in found.axis_poles:
        if not pole.allowed:
            where = "infinity" if pole.frequency == math.inf else f"j {pole.frequency:.6g} rad/s"
            if pole.multiplicity > 1:
                return f"its pole at {where} is {pole.multiplicity}-fold"
            return f"its pole at {where} has the residue {pole.residue:.6g}, not one above zero"
    return "Re K(s) < 0 somewhere in the right half-plane"


def _words(band: Band) -> str:
    if band.high == math.inf:
        return f"above {band.low:.6g} rad/s"
    return f"from {band.low:.6g} to {band.high:.6g} rad/s"


def _praise(found: PositiveReal) -> str:
    inside = [w for w in found.touches if 0.0 < w < math.inf]
    if inside:
        return f"{found.strictness}; Re K(jw) touches zero at w = {inside[0]:.6g} rad/s"
    return found.strictness
