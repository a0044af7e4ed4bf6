"""The greatest |S| of a rational transfer on the unit circle, proved by exact algebra."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from tautwave.analysis.exact.bounds import common_integers, is_schur, reduce_fraction
from tautwave.analysis.exact.polynomials import Poly, trim
from tautwave.analysis.exact.rational import Rational, constant
from tautwave.analysis.walls.passivity import LeakForm, square_series
from tautwave.analysis.walls.sampled import PulseTransfer

TIGHT = 1e-9
"""Excess of |S|**2 over 1 that still counts as passive: rounding of the device's map."""

ONE = Rational((Fraction(1),), (Fraction(1),))
Q = Rational((Fraction(1), Fraction(0)), (Fraction(1),))
"""One period of delay, 1 / z."""


class Gain(NamedTuple):
    """Greatest magnitude of a pulse transfer on the unit circle.

    Attributes
    ----------
    greatest : float
        sup |S| [1]; inf if the transfer itself is unstable.
    upper : float
        Proved upper bound of it, within 1e-10 as a rule.
    theta : float
        Where it is, w T in [0, pi]; for an unstable transfer the angle of its worst pole.
    stable : bool
        Whether all poles are inside the unit circle.
    """

    greatest: float
    upper: float
    theta: float
    stable: bool

    @property
    def passive(self) -> bool:
        """Whether no wave leaves larger than it came, to rounding."""
        return self.stable and self.upper * self.upper <= 1.0 + TIGHT

    def frequency(self, period: float) -> float:
        """Return where the magnitude is greatest [Hz]."""
        return self.theta / (2.0 * math.pi * period)


def greatest_gain(transfer: PulseTransfer) -> Gain:
    """Return the greatest |S(e^(j theta))|, proved; see `Gain`."""
    top, bottom = reduce_fraction(transfer.numerator, transfer.denominator)
    if not is_schur(bottom):
        poles = np.roots([float(value) for value in bottom])
        worst = poles[np.argmax(np.abs(poles))]
        return Gain(math.inf, math.inf, abs(float(np.angle(worst))), stable=False)
    if not any(top):
        return Gain(0.0, 0.0, 0.0, stable=True)
    form = LeakForm(*common_integers(square_series(top), square_series(bottom), [Fraction(0)]))
    square, upper, theta = form.greatest()
    return Gain(math.sqrt(square), math.sqrt(upper), theta, stable=True)


def as_pulse(transfer: Rational) -> PulseTransfer:
    """Return a function of q = 1/z with its coefficients by falling powers of z."""
    length = max(len(transfer.num), len(transfer.den))
    return PulseTransfer(_by_z(transfer.num, length), _by_z(transfer.den, length))


# -- helpers ---------------------------------------------------------------------------------------


def _whole(value: float) -> Rational:
    """Return a float as the binary fraction that it is."""
    return constant(Fraction(value))


def _power(base: Rational, count: int) -> Rational:
    if base is Q:
        return Rational((Fraction(1), *[Fraction(0)] * count), (Fraction(1),))
    out = ONE
    for _ in range(count):
        out = out * base
    return out


def _filter(gain: float) -> Rational:
    step = _whole(gain)
    return step / (ONE - (ONE - step) * Q)


def _by_z(p: Poly, length: int) -> tuple[Fraction, ...]:
    rising = tuple(reversed(p))
    padded = rising + (Fraction(0),) * (length - len(rising))
    return trim(padded) or (Fraction(0),)
