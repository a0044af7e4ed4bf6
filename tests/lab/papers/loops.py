"""Feedback loops 1 + L(s) = 0: revised Bode criterion, stable gains, modulus margin.

L = controller impedance x device admittance (dimensionless), negative feedback. The revised Bode
criterion says: no unstable open-loop pole, and |L| < 1 wherever the phase is 180 degrees, suffice.
They are not needed: L = k (s+1)^2/s^3 is stable for k > 1/2 with |L| > 1 there. So it names
candidate frequencies, and poles (rational) or the argument principle (delay) decide.

Source: Berdahl et al., the second seed, eqs 5-6, with poles of L on the axis taken care of.
Frequencies in rad/s; for loops in z: angles in rad through the bilinear map.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.axis import axis_grid
from tautwave.analysis.exact.delay_roots import DelayLoop
from tautwave.analysis.exact.polynomials import Poly
from tautwave.analysis.exact.positive_real import axis_poles
from tautwave.analysis.exact.rational import Delayed, Rational
from tautwave.errors import ConfigError
from tests.analysis.reference.delay_loops import unstable_count
from tests.analysis.reference.passivity_scan import bisect, golden


class Candidate(NamedTuple):
    """A frequency [rad/s] at which L is real and at most -1, and its value."""

    frequency: float
    loop_gain: float


class RevisedBode(NamedTuple):
    """Result of `revised_bode`.

    sufficient : the criterion itself shows stability. candidates : frequencies where it does not.
    unstable_roots : closed-loop roots with positive real part; stable : none, and none on the axis.
    """

    sufficient: bool
    candidates: tuple[Candidate, ...]
    unstable_roots: int
    stable: bool


class ModulusMargin(NamedTuple):
    """Least |1 + L(jw)| [1] and its frequency [rad/s]: distance to instability, if stable."""

    margin: float
    frequency: float


def revised_bode(loop: Rational | Delayed) -> RevisedBode:
    """Apply the revised Bode criterion, then decide.

    Parameters
    ----------
    loop : Rational or Delayed
        L, proper; with a delay: strictly proper and delayed as a whole.

    Raises
    ------
    ConfigError
        If L is improper, or delayed in part only.
    """
    if isinstance(loop, Rational):
        if loop.relative_degree < 0:
            raise ConfigError("the loop has to be proper: it has a pole at infinity")
        candidates = _real_points(loop)
        roots = poly.half_planes(characteristic(loop, Fraction(1)))
        unstable, stable = roots.right, roots.right == roots.axis == 0
        held = loop
    else:
        held = _strictly_delayed(loop)
        candidates = _scan_real_points(loop)
        try:
            unstable = unstable_count(DelayLoop(held.den, held.num, loop.delay))
            stable = unstable == 0
        except ConfigError:  # a root on the axis
            unstable, stable = 0, False
    premise = not poly.half_planes(held.den).right and all(
        p.multiplicity == 1 and p.residue.real >= 0.0 for p in axis_poles(held)
    )
    return RevisedBode(premise and not candidates, tuple(candidates), unstable, stable)


def characteristic(loop: Rational, gain: Fraction) -> Poly:
    """Return D + gain N of L = N/D."""
    return poly.add(loop.den, poly.scale(loop.num, gain))


def modulus_margin(loop: Rational | Delayed, low: float = 0.0, high: float = 0.0) -> ModulusMargin:
    """Return the least distance of L(jw) from -1.

    Parameters
    ----------
    loop : Rational or Delayed
        L. A rational one is searched over the whole axis, exactly.
    low, high : float
        Band [rad/s] to scan, with a delay only.
    """
    if isinstance(loop, Delayed):
        w = axis_grid(loop, low, high)
        size = np.abs(1.0 + loop.at(np.asarray(1j * w)))
        at = golden(lambda x: abs(1.0 + loop(1j * x)), w, int(np.argmin(size)))
        return ModulusMargin(abs(1.0 + loop(1j * at)), at)
    total = characteristic(loop, Fraction(1))
    top, bottom = _square(total), _square(loop.den)
    common = poly.gcd(top, bottom)
    top, bottom = poly.divide(top, common)[0], poly.divide(bottom, common)[0]
    turning = poly.add(
        poly.multiply(poly.derivative(top), bottom),
        poly.scale(poly.multiply(top, poly.derivative(bottom)), -1),
    )
    points = [Fraction(0), *(r.high for r in poly.positive_roots(turning))]
    points += [r.high for r in poly.positive_roots(top)]
    found = []
    for x in points:
        below = poly.evaluate(bottom, x)
        if below:
            ratio = poly.evaluate(top, x) / below
            found.append(ModulusMargin(math.sqrt(abs(float(ratio))), math.sqrt(float(x))))
    if len(top) == len(bottom):
        found.append(ModulusMargin(math.sqrt(abs(float(top[0] / bottom[0]))), math.inf))
    elif len(top) < len(bottom):
        found.append(ModulusMargin(0.0, math.inf))
    return min(found)


# -- helpers -------------------------------------------------------------------------------------


def _square(p: Poly) -> Poly:
    """Return |p(jw)|**2 as a polynomial in x = w**2."""
    return poly.even_odd(poly.multiply(p, poly.mirrored(p)))[0]


def _real_values(loop: Rational) -> list[tuple[float, float]]:
    """Return (w, L(jw)) where L is real: at 0 and where it crosses; always real: where L = -1."""
    even, odd = poly.even_odd(poly.multiply(loop.num, poly.mirrored(loop.den)))
    bottom = _square(loop.den)
    places = [r.high for r in poly.positive_roots(odd or poly.add(even, bottom))]
    return [
        (math.sqrt(float(x)), float(poly.evaluate(even, x) / below))
        for x in [Fraction(0), *places]
        if (below := poly.evaluate(bottom, x))
    ]


def _real_points(loop: Rational) -> list[Candidate]:
    return [Candidate(w, v) for w, v in _real_values(loop) if v <= -1.0 + 1e-12]


def _strictly_delayed(loop: Delayed) -> Rational:
    if loop.plain.num or loop.held.relative_degree < 1:
        raise ConfigError("the loop has to be strictly proper and delayed as a whole")
    return loop.held


def _scan_real_points(loop: Delayed) -> list[Candidate]:
    sizes = np.abs(loop.features())
    sizes = sizes[sizes > 0.0]
    low, high = 1e-4 * float(sizes.min(initial=1.0)), 4.0 * float(sizes.max(initial=1.0))
    while abs(loop(1j * high)) > 0.5:
        high *= 2.0
    w = axis_grid(loop, low, high)
    values = loop.at(np.asarray(1j * w))
    found = []
    for i in np.flatnonzero((values.imag[1:] < 0.0) != (values.imag[:-1] < 0.0)):
        if values.real[i] < 0.0 and values.real[i + 1] < 0.0:
            at = bisect(lambda x: loop(1j * x).imag, float(w[i]), float(w[i + 1]))
            if (value := loop(1j * at).real) <= -1.0:
                found.append(Candidate(at, value))
    return found
