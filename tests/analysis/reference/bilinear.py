"""Rational functions of rational functions, and the bilinear map among them."""

from __future__ import annotations

import math

from tautwave.analysis.exact.polynomials import Poly
from tautwave.analysis.exact.rational import Rational, rational


def substitute(f: Rational, inner: Rational) -> Rational:
    """Return f(inner)."""

    def horner(p: Poly) -> Rational:
        out = rational([0])
        for c in p:
            out = out * inner + c
        return out

    return horner(f.num) / horner(f.den)


def bilinear(law: Rational) -> Rational:
    """Return law(z) at z = (1 + s)/(1 - s): the unit circle becomes the axis, w = tan(theta/2)."""
    return substitute(law, rational([1, 1], [-1, 1]))


def angle_of(w: float) -> float:
    """Return the angle theta [rad] on the unit circle that `bilinear` puts at w on the axis."""
    return 2.0 * math.atan(w)
