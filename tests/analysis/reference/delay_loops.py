"""Loops with a delay: how many roots are unstable, and the gains at which one is on the axis.

Roots of p(s) + q(s) exp(-s delay) are counted by the argument of the function along the axis. Poles
of the open loop on the axis need no indentation: the function is entire.

Source: Michiels & Niculescu, Stability and Stabilization of Time-Delay Systems, 2007. Units: s in
rad/s, delays in s.
"""

from __future__ import annotations

import cmath
import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.axis import axis_grid
from tautwave.analysis.exact.delay_roots import (
    DelayLoop,
    Floats,
    _check_retarded,
    _floats,
    _scale,
    closed_loop,
)
from tautwave.analysis.exact.polynomials import (
    Poly,
    add,
    evaluate,
    even_odd,
    half_planes,
    mirrored,
    multiply,
    positive_roots,
)
from tautwave.analysis.exact.polynomials import scale as scaled
from tautwave.analysis.exact.rational import Complexes, Delayed, Rational, Sampled, rational
from tautwave.analysis.ports.necessity import Controller, Counterexample, growing_root
from tautwave.errors import ConfigError
from tests.analysis.reference.passivity_scan import bisect


class CriticalGain(NamedTuple):
    """A positive gain at which a root is on the axis, and its frequency [rad/s]."""

    gain: float
    frequency: float


def unstable_count(loop: DelayLoop) -> int:
    """Return how many roots have a positive real part (argument principle along the axis).

    Raises
    ------
    ConfigError
        If the loop is not retarded, or a root lies on the axis: exactly without a delay or at
        s = 0, to rounding elsewhere.
    """
    _check_retarded(loop)
    if loop.delay == 0.0 or not loop.late:
        return _unstable_roots(add(loop.now, loop.late))
    if not evaluate(add(loop.now, loop.late), Fraction(0)):
        raise ConfigError("a root lies on the axis, at s = 0")
    p, q = _floats(loop.now), _floats(loop.late)
    order = len(p) - 1
    scale = _scale(p)
    high = max(1.01 * _reach(loop), 1e-3 * scale)
    shape = Delayed(rational([1], list(loop.now)), loop.delay, _or_one(loop.late))
    w = np.concatenate([[0.0], axis_grid(shape, 1e-6 * high, high)])
    values = _values(p, q, loop.delay, w)
    for _ in range(60):
        if not values.all():
            raise ConfigError(f"a root lies on the axis at {float(w[values == 0][0]):.6g} rad/s")
        steps = np.abs(np.angle(values[1:] / values[:-1]))
        wide = np.flatnonzero(~(steps < math.pi / 4.0))
        if not len(wide):
            break
        extra = 0.5 * (w[wide] + w[wide + 1])
        w = np.insert(w, wide + 1, extra)
        values = np.insert(values, wide + 1, _values(p, q, loop.delay, extra))
    else:
        raise ConfigError(f"a root lies on the axis near {float(w[wide[0]]):.6g} rad/s")
    turn = float(np.sum(np.angle(values[1:] / values[:-1])))
    # Above, the late part is less than half of the rest: it turns as its undelayed roots do.
    turn -= cmath.phase(values[-1] / np.polyval(p, 1j * high))
    for root in np.roots(p):
        angle = cmath.phase(1j * high - root)
        turn += 0.5 * math.pi - (angle if angle > -0.5 * math.pi else angle + 2.0 * math.pi)
    return round(order / 2.0 - turn / math.pi)


def verified_unstable(example: Counterexample, controller: Controller) -> bool:
    """Return whether the loop has a growing root, found again without the construction's guess."""
    total = example.total
    if isinstance(controller, Sampled):
        return growing_root(controller, total, example.root) is not None
    loop = closed_loop(controller, total.impedance())
    if isinstance(controller, Rational):
        return half_planes(add(loop.now, loop.late)).right > 0
    return unstable_count(loop) > 0


def critical_gains(
    fixed: Poly, plain: Poly, late: Poly, delay: float, low: float, high: float
) -> list[CriticalGain]:
    """Return gains k > 0 that put a root of fixed + k (plain + late e^(-s delay)) on the axis.

    Parameters
    ----------
    fixed, plain, late : Poly
        Exact polynomials in s.
    delay : float
        [s].
    low, high : float
        Band of frequencies searched [rad/s].

    Returns
    -------
    list of CriticalGain
        Rising in gain; the first one is where a loop that is stable for small k stops being so.
    """
    shape = Delayed(_or_one(late), delay, rational(list(fixed), list(plain or fixed)))
    w = axis_grid(shape, low, high, 20_000)

    def gain(s: npt.NDArray[np.complex128]) -> Complexes:
        bottom = np.polyval(_floats(plain), s) + np.polyval(_floats(late), s) * np.exp(-s * delay)
        return np.asarray(-np.polyval(_floats(fixed), s) / bottom, np.complex128)

    def side(x: float) -> float:
        return float(gain(np.array([1j * x]))[0].imag)

    values = gain(np.asarray(1j * w))
    found = []
    for i in np.flatnonzero((values.imag[1:] < 0.0) != (values.imag[:-1] < 0.0)):
        at = bisect(side, float(w[i]), float(w[i + 1]))
        value = complex(gain(np.array([1j * at]))[0])
        # a change of sign at a pole of k(w) is none: there the imaginary part does not vanish
        if value.real > 0.0 and abs(value.imag) < 1e-6 * abs(value):
            found.append(CriticalGain(value.real, at))
    return sorted(found)


def _unstable_roots(p: Poly) -> int:
    """Return how many roots a polynomial has right of the axis (Routh, exactly)."""
    if not p:
        raise ConfigError("the characteristic function is zero everywhere")
    roots = half_planes(p)
    if roots.axis:
        where = "at s = 0" if not p[-1] else "away from s = 0"
        raise ConfigError(f"a root lies on the axis, {where}")
    return roots.right


def _reach(loop: DelayLoop) -> float:
    """Return the frequency [rad/s] above which the late part is less than half of the rest."""
    squares = [even_odd(multiply(p, mirrored(p)))[0] for p in (loop.now, loop.late)]
    roots = positive_roots(add(squares[0], scaled(squares[1], -4)))
    return math.sqrt(roots[-1].value) if roots else 0.0


def _values(p: Floats, q: Floats, delay: float, w: Floats) -> Complexes:
    s = 1j * w
    return np.asarray(np.polyval(p, s) + np.polyval(q, s) * np.exp(-s * delay), np.complex128)


def _or_one(p: Poly) -> Rational:
    return rational(list(p) or [1])
