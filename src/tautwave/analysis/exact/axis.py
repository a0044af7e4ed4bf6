"""The +-90 degree test along the frequency axis: where it fails, by how much, with delay too.

The phase of a passive impedance stays within +-90 degrees. That is necessary, not sufficient
(poles count too: `tautwave.analysis.exact.positive_real`). Its margin is 90 degrees less the
greatest |phase|: negative where a user exists who is driven unstable. For rational functions every
figure comes from roots of polynomials, for others from a refined scan of a stated band.

Phases in degrees within (-180, 180], frequencies in rad/s. Source: Berdahl, Smith & Niemeyer.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.positive_real import (
    Band,
    axis_roots,
    leading,
    negative_intervals,
    resistance,
)
from tautwave.analysis.exact.rational import Rational, Response
from tautwave.analysis.grids import merged
from tautwave.errors import ConfigError

Floats = npt.NDArray[np.float64]
_PER_TURN = 40  # points of a scan per turn of the phase
_MOST = 2_000_000
_ROUNDING = 1e-9  # [degrees]


class PassivityMargin(NamedTuple):
    """Result of the test.

    margin_deg : 90 less the greatest |phase|; frequency [rad/s] (0 and inf: the limits) and
    phase_deg there. negative : bands with Re K < 0. resistance : least Re K [N s/m or N m s/rad]
    and resistance_frequency where it is, over the inside of the band (-inf beside a pole).
    """

    margin_deg: float
    frequency: float
    phase_deg: float
    negative: tuple[Band, ...]
    resistance: float
    resistance_frequency: float


def passivity_margin(k: Rational) -> PassivityMargin:
    """Return the phase margin of passivity of a rational function over the whole axis, exactly.

    Raises
    ------
    ConfigError
        If K is zero: it has no phase.
    """
    if not k.num:
        raise ConfigError("zero has no phase")
    candidates = _limits(k)
    mixed = poly.multiply(k.num, poly.mirrored(k.den))
    even, odd = poly.even_odd(mixed)
    # d arg K/dw = Re K'/K = 0; and where the phase passes 180 degrees
    slope = poly.add(
        poly.multiply(poly.derivative(k.num), k.den),
        poly.scale(poly.multiply(k.num, poly.derivative(k.den)), -1),
    )
    both = poly.multiply(k.num, k.den)
    turning = poly.even_odd(poly.multiply(slope, poly.mirrored(both)))[0]
    singular = poly.even_odd(poly.multiply(both, poly.mirrored(both)))[0]
    for p in (_without(turning, singular), _without(odd, singular)):
        for root in poly.positive_roots(p):
            x, w = root.high, math.sqrt(root.value)
            value = complex(float(poly.evaluate(even, x)), w * float(poly.evaluate(odd, x)))
            candidates.append((w, _degrees(value)))
    frequency, phase = max(candidates, key=lambda c: (round(abs(c[1]), 9), -c[0]))
    top, bottom = resistance(k)
    negative = tuple(Band(a.value, b.value) for a, b in negative_intervals(top))
    least, where = _least(top, bottom)
    margin = 90.0 - abs(phase)
    if not negative and abs(margin) < _ROUNDING:
        margin = 0.0
    return PassivityMargin(margin, frequency, phase, negative, least, where)


def axis_grid(k: Response, low: float, high: float, points: int = 2000) -> Floats:
    """Return rising frequencies [rad/s] from low to high that follow every feature of K.

    Raises
    ------
    ConfigError
        If the band is empty or holds too many turns of the phase.
    """
    if not 0.0 < low < high < math.inf:
        raise ConfigError(f"a band needs 0 < low < high (got {low} to {high} rad/s)")
    parts = [np.geomspace(low, high, points)]
    offsets = np.concatenate([[0.0], np.geomspace(0.02, 200.0, 60)])
    for feature in k.features():
        centre, width = abs(feature.imag), max(abs(feature.real), 1e-9 * abs(feature))
        parts += [centre + width * offsets, centre - width * offsets]
    if lag := _lag(k):
        turn = 2.0 * math.pi / lag
        count = _PER_TURN * (high - low) / turn
        if count > _MOST:
            raise ConfigError(
                f"{high:.3g} rad/s is {high / turn:.3g} turns of the delay: choose a lower band"
            )
        parts.append(np.linspace(low, high, int(count) + 2))
    w = merged(parts)
    return np.asarray(w[(w >= low) & (w <= high)], np.float64)


# -- helpers -------------------------------------------------------------------------------------


def _degrees(value: complex) -> float:
    return math.degrees(cmath.phase(value))


def _without(p: poly.Poly, q: poly.Poly) -> poly.Poly:
    """Return p without the factors it shares with q."""
    while len(common := poly.gcd(p, q)) > 1 and p:
        p = poly.divide(p, common)[0]
    return p


def _limits(k: Rational) -> list[tuple[float, float]]:
    """Return (w, phase) on both sides of every zero and pole on the axis, at 0 and at infinity."""
    zeros, poles = dict(axis_roots(k.num)), dict(axis_roots(k.den))
    limits = [(math.inf, _wrapped(-90.0 * k.relative_degree + (180.0 if k.num[0] < 0 else 0.0)))]
    for w in sorted({0.0, *zeros, *poles}):
        s, m, n = 1j * w, zeros.get(w, 0), poles.get(w, 0)
        factor = _degrees(leading(k.num, s, m) / leading(k.den, s, n))
        limits.append((w, _wrapped(factor + 90.0 * (m - n))))
        if w:
            limits.append((w, _wrapped(factor - 90.0 * (m - n))))
    return limits


def _wrapped(degrees: float) -> float:
    return 180.0 - (180.0 - degrees) % 360.0


def _least(top: poly.Poly, bottom: poly.Poly) -> tuple[float, float]:
    """Return the infimum of top/bottom over x >= 0 and the frequency w of it."""
    if not top:
        return 0.0, 0.0
    lead = float(top[0] / bottom[0])
    far = [0.0, lead, math.copysign(math.inf, lead)][1 + _sign(len(top) - len(bottom))]
    start = float(top[-1] / bottom[-1]) if bottom[-1] else math.copysign(math.inf, float(top[-1]))
    candidates = [(far, math.inf), (start, 0.0)]
    for root in poly.positive_roots(bottom):
        side = math.copysign(math.inf, float(poly.evaluate(top, root.high)))
        candidates.append((side, math.sqrt(root.value)))
    turning = poly.add(
        poly.multiply(poly.derivative(top), bottom),
        poly.scale(poly.multiply(top, poly.derivative(bottom)), -1),
    )
    for root in poly.positive_roots(turning):
        if below := poly.evaluate(bottom, root.high):
            value = float(poly.evaluate(top, root.high) / below)
            candidates.append((value, math.sqrt(root.value)))
    return min(candidates)


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)


def _lag(k: Response) -> float:
    """Return the pure delay [s] in K, whose phase has no limit."""
    return float(getattr(k, "delay", 0.0)) + 2.0 * float(getattr(k, "period", 0.0))
