"""Rational functions with exact coefficients, with a delay, and as a sampled law acts on a device.

Impedances are force over velocity [N s/m or N m s/rad], admittances their inverse, both as
functions of s [rad/s]. All three kinds answer `f(s)`, `f.slope(s)` = df/ds and `f.at(array)`.
"""

from __future__ import annotations

import cmath
import numbers
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.polynomials import Number, Poly, exact, polynomial
from tautwave.errors import ConfigError

Complexes = npt.NDArray[np.complex128]
Floats = npt.NDArray[np.float64]


class Response(Protocol):
    """A function of s that is real for real s."""

    def __call__(self, s: complex) -> complex:
        """Return the value at s [rad/s]."""

    def slope(self, s: complex) -> complex:
        """Return the derivative by s."""

    def at(self, s: Complexes) -> Complexes:
        """Return the values at an array of points, in its shape."""

    def features(self) -> Complexes:
        """Return the points near which it changes quickly [rad/s]."""


@dataclass(frozen=True)
class Rational:
    """num/den without common factors, den monic; `rational` builds one from any coefficients.

    Coefficients are exact (`Fraction`), highest power first. Numbers may stand on either side:
    `2 * S`, `Fraction(1, 3) / (S + 1)`.
    """

    num: Poly
    den: Poly
    __array_ufunc__ = None  # a NumPy scalar on the left leaves the arithmetic to us

    @cached_property
    def _floats(self) -> tuple[Floats, Floats]:
        return _as_floats(self.num), _as_floats(self.den)

    def __call__(self, s: complex) -> complex:
        """Return the value at s [rad/s]."""
        num, den = self._floats
        return complex(_horner(num, s) / _horner(den, s))

    def slope(self, s: complex) -> complex:
        """Return the derivative by s."""
        num, den = self._floats
        bottom = _horner(den, s)
        top = _horner(np.polyder(num), s) * bottom - _horner(num, s) * _horner(np.polyder(den), s)
        return complex(top / bottom**2)

    def at(self, s: Complexes) -> Complexes:
        """Return the values at an array of points, in its shape."""
        num, den = self._floats
        return np.asarray(np.polyval(num, s) / np.polyval(den, s), np.complex128)

    def zeros(self) -> Complexes:
        """Return the zeros [rad/s], rounded."""
        return _roots(self._floats[0])

    def poles(self) -> Complexes:
        """Return the poles [rad/s], rounded."""
        return _roots(self._floats[1])

    def features(self) -> Complexes:
        """Return the points near which it changes quickly: zeros and poles [rad/s]."""
        return np.concatenate([self.zeros(), self.poles()])

    @property
    def relative_degree(self) -> int:
        """Degree of the denominator less that of the numerator."""
        return len(self.den) - len(self.num)

    def __add__(self, other: Rational | Number) -> Rational:
        b = _lift(other)
        if b is None:
            return NotImplemented
        top = poly.add(poly.multiply(self.num, b.den), poly.multiply(b.num, self.den))
        return _reduced(top, poly.multiply(self.den, b.den))

    __radd__ = __add__

    def __neg__(self) -> Rational:
        return Rational(poly.scale(self.num, -1), self.den)

    def __sub__(self, other: Rational | Number) -> Rational:
        b = _lift(other)
        return NotImplemented if b is None else self + -b

    def __rsub__(self, other: Rational | Number) -> Rational:
        return -self + other

    def __mul__(self, other: Rational | Number) -> Rational:
        b = _lift(other)
        if b is None:
            return NotImplemented
        return _reduced(poly.multiply(self.num, b.num), poly.multiply(self.den, b.den))

    __rmul__ = __mul__

    def inverse(self) -> Rational:
        """Return 1 over it.

        Raises
        ------
        ConfigError
            If it is zero.
        """
        return _reduced(self.den, self.num)

    def __truediv__(self, other: Rational | Number) -> Rational:
        b = _lift(other)
        return NotImplemented if b is None else self * b.inverse()

    def __rtruediv__(self, other: Rational | Number) -> Rational:
        return self.inverse() * other


@dataclass(frozen=True)
class Delayed:
    """plain(s) + held(s) exp(-s delay), delay in s: a controller whose output comes late."""

    held: Rational
    delay: float
    plain: Rational = Rational((), (Fraction(1),))

    def __call__(self, s: complex) -> complex:
        """Return the value at s [rad/s]."""
        return self.plain(s) + self.held(s) * cmath.exp(-s * self.delay)

    def slope(self, s: complex) -> complex:
        """Return the derivative by s."""
        late = self.held.slope(s) - self.delay * self.held(s)
        return self.plain.slope(s) + late * cmath.exp(-s * self.delay)

    def at(self, s: Complexes) -> Complexes:
        """Return the values at an array of points, in its shape."""
        return self.plain.at(s) + self.held.at(s) * np.exp(-s * self.delay)

    def features(self) -> Complexes:
        """Return the points near which it changes quickly [rad/s]."""
        return np.concatenate([self.plain.features(), self.held.features()])


@dataclass(frozen=True)
class Sampled:
    """A law force = law(z) position on samples, held for a period, as an impedance at the device.

    `period` in s; `delay` in s until a held force acts, on top of the hold; `device` is the mass,
    damping and stiffness that stand before it. The value at s is that of the baseband,
    law(e^sT) (1 - e^-sT) e^(-s delay) / (s**2 T): the aliases that a sampler adds belong to the
    exact loop (`tautwave.analysis.walls.sampled_user`), not to this.
    """

    law: Rational
    period: float
    delay: float = 0.0
    device: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __call__(self, s: complex) -> complex:
        """Return the value at s [rad/s]."""
        t = self.period
        m, b, k = self.device
        hold = (1.0 - cmath.exp(-s * t)) / (s * s * t)
        return self.law(cmath.exp(s * t)) * hold * cmath.exp(-s * self.delay) + m * s + b + k / s

    def slope(self, s: complex) -> complex:
        """Return the derivative by s."""
        t = self.period
        m, _, k = self.device
        z, late = cmath.exp(s * t), cmath.exp(-s * self.delay)
        hold = (1.0 - 1.0 / z) / (s * s * t)
        turn = 1.0 / (z * s * s) - 2.0 * hold / s - self.delay * hold
        return late * (t * z * self.law.slope(z) * hold + self.law(z) * turn) + m - k / (s * s)

    def at(self, s: Complexes) -> Complexes:
        """Return the values at an array of points, in its shape."""
        t = self.period
        m, b, k = self.device
        hold = -np.expm1(-s * t) / (s * s * t)
        law = self.law.at(np.exp(s * t)) * hold * np.exp(-s * self.delay)
        return np.asarray(law + m * s + b + k / s)

    def features(self) -> Complexes:
        """Return the points near which it changes quickly [rad/s], below the Nyquist frequency."""
        inside = self.law.features()
        inside = inside[np.abs(inside) > 1e-12]  # z = 0: a pure delay
        return np.asarray(np.log(inside.astype(np.complex128)) / self.period)

    def with_device(self, mass: float, damping: float, stiffness: float) -> Sampled:
        """Return it behind a device: SI, linear or rotary."""
        m, b, k = self.device
        return replace(self, device=(m + mass, b + damping, k + stiffness))


def rational(num: Sequence[Number], den: Sequence[Number] = (1,)) -> Rational:
    """Return num/den with common factors removed exactly.

    Parameters
    ----------
    num, den : sequence of int, float, str or Fraction
        Coefficients, highest power first. A float means the decimal it prints as.

    Raises
    ------
    ConfigError
        If the denominator is zero or a coefficient is not finite.
    """
    return _reduced(polynomial(num), polynomial(den))


def constant(value: Number) -> Rational:
    """Return the function that is `value` everywhere."""
    return _reduced(poly.trim([exact(value)]), (Fraction(1),))


S = Rational((Fraction(1), Fraction(0)), (Fraction(1),))
"""The function s: `S * S + 2 * ...` reads as it is written."""


# -- helpers -------------------------------------------------------------------------------------


def _reduced(num: Poly, den: Poly) -> Rational:
    if not den:
        raise ConfigError("the denominator of a rational function has to differ from zero")
    if not num:
        return Rational((), (Fraction(1),))
    common = poly.gcd(num, den)
    if len(common) > 1:
        num, den = poly.divide(num, common)[0], poly.divide(den, common)[0]
    lead = 1 / den[0]
    return Rational(poly.scale(num, lead), poly.scale(den, lead))


def _lift(value: object) -> Rational | None:
    """Return an operand as a function; None if it is not a number, so that Python raises."""
    if isinstance(value, Rational):
        return value
    return constant(value) if isinstance(value, float | str | numbers.Rational) else None


def _as_floats(p: Poly) -> Floats:
    return np.array([float(c) for c in p] or [0.0])


def _horner(p: npt.NDArray[np.floating[Any]], s: complex) -> complex:
    out = 0j
    for c in p:
        out = out * s + c
    return out


def _roots(p: Floats) -> Complexes:
    return np.asarray(np.roots(p), np.complex128)
