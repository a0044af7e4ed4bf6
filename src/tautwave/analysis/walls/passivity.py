"""Device damping that a sampled controller needs: Colgate and Schenkel's condition, proved.

A controller E(z) with hold, on a device with viscous damping b and any mass, is passive exactly if

    b >= (T/2) [Re E - cot(theta/2) Im E]        for all 0 < theta <= pi.

Times the squared magnitude of the denominator the right side is a polynomial in
t = sin(theta/2)**2, since sin(k theta) cot(theta/2) is a sum of cosines; so the bound is the
greatest y = 2 b / T with y Q(t) - P(t) < 0 somewhere in [0, 1], theta -> 0 included. A delay of
d + f periods, 0 < f < 1, holds a mixture of two samples: y**2 Q - y P - f (1 - f) |N|**2.

Roots of the derivative and a search propose the greatest y; a proof in integers
(`tautwave.analysis.exact.bounds`) closes the interval around it or finds a better t.

Sources: Colgate & Schenkel 1997, eq. (1); with a share of a period: largest eigenvalue of the
rank-two Hermitian form of the delayed hold, written here.
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.bounds import (
    Whole,
    add_scaled,
    common_integers,
    find_negative,
    is_schur,
    reduce_fraction,
    value_at,
)
from tautwave.analysis.walls.sampled import (
    PulseTransfer,
    SampledWall,
    check_wall,
    split_delay,
    wall_transfer,
)
from tautwave.errors import ConfigError

Floats = npt.NDArray[np.float64]

SLACK = 1e-10
"""Relative width of the interval in which the bound is proved to lie, if nothing is in the way."""


class Leak(NamedTuple):
    """What a controller takes from a device.

    Attributes
    ----------
    damping : float
        Least viscous damping that makes it passive, >= 0, inf if none does [N s/m or N m s/rad].
    supremum : float
        The same before it is cut off at 0: below 0 is damping to spare at every frequency.
    upper : float
        Proved upper bound of `supremum`, within a relative 1e-10 as a rule.
    theta : float
        Where it is largest, w T in [0, pi]; 0 is the limit theta -> 0. For an unstable
        controller the angle of the offending pole.
    frequency : float
        The same in Hz.
    """

    damping: float
    supremum: float
    upper: float
    theta: float
    frequency: float


@functools.lru_cache(maxsize=1024)  # called again for each sentence about a wall
def wall_leak(wall: SampledWall) -> Leak:
    """Return the damping a wall needs, filter and delay included.

    Raises
    ------
    ConfigError
        A number of the wall is out of range.
    """
    check_wall(wall)
    return needed_damping(wall_transfer(wall), wall.period, wall.delay)


def needed_damping(transfer: PulseTransfer, period: float, delay: float = 0.0) -> Leak:
    """Return the device damping that E(z) z**-delay needs to be passive.

    A pole on or outside the unit circle makes it infinite; at z = 1 whatever its residue, since a
    device that moves on at constant speed is pushed ever harder one way or the other. Exempting a
    lossless resonator of just the right phase is not attempted.

    Parameters
    ----------
    transfer : PulseTransfer
        E(z), real, causal. Common factors are cancelled.
    period : float
        T [s].
    delay : float
        Periods, with a fraction.

    Raises
    ------
    ConfigError
        E is not causal, its denominator is zero, or a number is not finite.
    """
    numbers = (*transfer.numerator, *transfer.denominator, period, delay)
    if not all(map(math.isfinite, numbers)) or period <= 0.0 or delay < 0.0:
        raise ConfigError("E(z): coefficients must be finite, period positive, delay not negative")
    if not any(transfer.denominator):
        raise ConfigError("E(z): the denominator is zero")
    top, bottom = reduce_fraction(transfer.numerator, transfer.denominator)
    if len(top) > len(bottom):
        raise ConfigError(
            f"E(z): the numerator's degree {len(top) - 1} exceeds the denominator's "
            f"{len(bottom) - 1}; it would need future samples"
        )
    if not is_schur(bottom):
        poles = np.roots([float(value) for value in bottom])
        theta = abs(float(np.angle(poles[np.argmax(np.abs(poles))])))
        return _leak(math.inf, math.inf, theta, period)
    form = leak_form(top, bottom, delay)
    value, upper, theta = form.greatest()
    return _leak(0.5 * period * value, 0.5 * period * upper, theta, period)


def _leak(supremum: float, upper: float, theta: float, period: float) -> Leak:
    return Leak(max(supremum, 0.0), supremum, upper, theta, theta / (2.0 * math.pi * period))


class LeakForm(NamedTuple):
    """y**2 q - y p - n >= 0 (y q - p >= 0 where n is zero), as Chebyshev series in cos theta.

    All three are integers over one common factor.
    """

    p: Whole
    q: Whole
    n: Whole

    @property
    def mixed(self) -> bool:
        """Whether a share of a period is in the delay."""
        return any(self.n)

    def values(self, theta: Floats) -> Floats:
        """Return the needed y at angles, in floats; shape (n,)."""
        chebyshev = np.polynomial.chebyshev  # NumPy loads it when it is first used
        p, q, n = (_floats(part, self.q) for part in self)
        cosine = np.cos(theta)
        below = np.maximum(chebyshev.chebval(cosine, q), 1e-300)
        ratio = chebyshev.chebval(cosine, p) / below
        if not self.mixed:
            return np.asarray(ratio)
        share = np.maximum(chebyshev.chebval(cosine, n) / below, 0.0)
        return np.asarray(0.5 * (ratio + np.sqrt(ratio * ratio + 4.0 * share)))

    def greatest(self) -> tuple[float, float, float]:
        """Return the greatest y, a proved upper bound of it, and its theta."""
        powers = LeakForm(*(_in_powers(part) for part in self))
        thetas = self._proposals()
        # Where several are as great the lowest frequency is reported.
        value, best = max(((_exact(powers, t), t) for t in _places(thetas)), key=_rank)
        scale = abs(value)
        if scale == 0.0:
            scale = float(np.abs(self.values(np.linspace(0.0, math.pi, 65))).max())
        slack = SLACK * scale
        while True:
            upper = math.nextafter(value + slack, math.inf)
            negative = find_negative(_shifted(powers, Fraction(upper)))
            if negative is None:
                return value, upper, 2.0 * math.asin(math.sqrt(best))
            slack *= 2.0  # ends even where the search cannot follow
            ends = [math.sqrt(t) for t in negative]
            spread = np.linspace(0.5 * ends[0], min(1.0, 2.0 * ends[1]), 65)
            near = self._climb(2.0 * np.arcsin(spread))
            better = [*negative, *map(Fraction, _places(near))]
            others = [(_exact(powers, t), float(t)) for t in better]
            value, best = max([(value, best), *others], key=_rank)

    def _proposals(self) -> Floats:
        """Return the angles at which the greatest y may be."""
        degree = len(self.p) + len(self.q)
        grid = np.concatenate(
            [np.geomspace(1e-7, 1e-2, 60), np.linspace(1e-2, math.pi, 6 * degree + 60)]
        )
        proposals = [self._climb(grid)]
        if not self.mixed and 3 < degree <= ALGEBRAIC:
            chebyshev = np.polynomial.chebyshev
            p, q, _ = (_floats(part, self.q) for part in self)
            slope = chebyshev.chebsub(
                chebyshev.chebmul(chebyshev.chebder(p), q),
                chebyshev.chebmul(p, chebyshev.chebder(q)),
            )
            # A denormal at the end, of a damping of 1e-323, overflows the companion matrix.
            slope[np.abs(slope) < 1e-250 * np.abs(slope).max()] = 0.0
            slope = np.trim_zeros(slope, "b")
            if len(slope) > 1:
                roots = chebyshev.chebroots(slope)
                real = roots.real[np.abs(roots.imag) < 1e-6]
                proposals.append(np.arccos(np.clip(real, -1.0, 1.0)))
        return np.concatenate(proposals)

    def _climb(self, grid: Floats) -> Floats:
        """Return the angle of the greatest y near the best point of a grid; shape (1,)."""
        for _ in range(12):
            at = int(np.argmax(self.values(grid)))
            low, high = grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)]
            if not high > low:
                break
            grid = np.linspace(low, high, 17)
        return np.array([grid[int(np.argmax(self.values(grid)))]])


ALGEBRAIC = 80
"""Degree up to which the extrema are proposed as roots of a polynomial too."""


def leak_form(top: list[Fraction], bottom: list[Fraction], delay: float) -> LeakForm:
    """Return the form of E = top / bottom (highest power first), late by `delay` periods."""
    whole, rest = split_delay(delay)
    share = Fraction(rest)
    products = _laurent(top, bottom, len(bottom) - len(top))
    p = [Fraction(0)] * (len(top) + len(bottom) + whole + 2)
    for later, part in ((whole, 1 - share), (whole + 1, share)):
        if part:
            for power, value in products.items():
                _add_kernel(p, power - later, part * value)
    squares = [square_series(bottom), [share * (1 - share) * value for value in square_series(top)]]
    ints = common_integers(p, *squares)
    return LeakForm(*ints)


def _laurent(top: list[Fraction], bottom: list[Fraction], behind: int) -> dict[int, Fraction]:
    """Return the coefficients of N(z) D(1/z) by power, N starting `behind` powers below D."""
    out: dict[int, Fraction] = {}
    for i, a in enumerate(top):
        for j, b in enumerate(bottom):
            power = j - i - behind
            out[power] = out.get(power, Fraction(0)) + a * b
    return out


def _add_kernel(series: list[Fraction], power: int, value: Fraction) -> None:
    """Add what value z**power gives to Re - cot(theta/2) Im: a Dirichlet kernel."""
    order = -power
    if power > 0:
        order = power - 1
        value = -value
    series[0] += value
    for at in range(1, order + 1):
        series[at] += 2 * value


def square_series(poly: list[Fraction]) -> list[Fraction]:
    """Return |poly(e^(j theta))|**2 as a Chebyshev series in cos theta; either order."""
    length = len(poly)
    out = [
        2 * sum((poly[i] * poly[i + apart] for i in range(length - apart)), Fraction(0))
        for apart in range(length)
    ]
    out[0] /= 2
    return out


def _floats(part: Whole, scale: Whole) -> Floats:
    """Return integers over the largest of `scale`, as floats."""
    largest = max(map(abs, scale))
    return np.array([value / largest for value in part])


def _in_powers(series: Whole) -> Whole:
    """Return a Chebyshev series in 1 - 2 t as powers of t."""
    out: Whole = [0]
    before, here = [1], [1, -2]
    for value in series:
        out = add_scaled(out, before, value)
        double = add_scaled([2 * a for a in here], [0, *here], -4)
        before, here = here, add_scaled(double, before, -1)
    return out


def _places(thetas: Floats) -> list[float]:
    """Return t of the angles, and both ends."""
    return [0.0, 1.0, *(math.sin(0.5 * float(theta)) ** 2 for theta in thetas)]


def _rank(found: tuple[float, float]) -> tuple[float, float]:
    return found[0], -found[1]


def _exact(powers: LeakForm, t: float | Fraction) -> float:
    """Return the needed y at t, rounded once or twice."""
    p, q, n = (value_at(part, Fraction(t)) for part in powers)
    ratio = float(p / q)
    if n == 0:
        return ratio
    return 0.5 * (ratio + math.sqrt(ratio * ratio + 4.0 * float(n / q)))


def _shifted(powers: LeakForm, y: Fraction) -> Whole:
    """Return a positive multiple of y**2 q - y p - n, or of y q - p where n is zero."""
    top, bottom = y.numerator, y.denominator
    if not any(powers.n):
        return add_scaled([top * value for value in powers.q], powers.p, -bottom)
    out = add_scaled([top * top * value for value in powers.q], powers.p, -top * bottom)
    return add_scaled(out, powers.n, -bottom * bottom)
