"""Gains for which a loop is stable."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.positive_real import Band
from tautwave.analysis.exact.rational import Rational
from tests.lab.papers.loops import _real_values, characteristic


def stable_gains(loop: Rational) -> tuple[Band, ...]:
    """Return the open intervals of gains k > 0 with 1 + k L stable, exactly decided (Routh).

    Ends are gains at which a root is on the axis or at infinity, to double precision.
    """
    ends = {0.0, math.inf}
    ends |= {-1.0 / v for _, v in _real_values(loop) if v < 0.0}
    if loop.relative_degree == 0:
        ends |= {float(-loop.den[0] / loop.num[0])}
    rising = sorted(k for k in ends if k >= 0.0)
    found: list[Band] = []
    for low, high in pairwise(rising):
        middle = 2.0 * low + 1.0 if high == math.inf else 0.5 * (low + high)
        total = characteristic(loop, Fraction(middle))
        if len(total) >= len(loop.den) and poly.is_hurwitz(total):
            found.append(Band(low, high))
    return tuple(found)


def unconditionally_stable(loop: Rational) -> bool:
    """Return whether 1 + k L is stable for every gain k > 0.

    The passivity theorem promises it for positive-real factors, one of them strictly; a delay, a
    hold or a sampler takes it away.
    """
    return stable_gains(loop) == (Band(0.0, math.inf),)
