"""Roots of p(s) + q(s) exp(-s delay): how many are unstable, and the rightmost ones.

A linear loop with a pure delay has such a characteristic function. With deg q < deg p (retarded)
only finitely many roots lie right of any line; they are counted by the argument of the function
along the axis and found as eigenvalues of a Chebyshev discretisation, refined by Newton. Poles of
the open loop on the axis need no indentation: the function is entire.

Sources: Michiels & Niculescu, Stability and Stabilization of Time-Delay Systems, 2007; Breda,
Maset & Vermiglio, SIAM J. Sci. Comput. 27, 2005 (Chebyshev). Units: s in rad/s, delays in s.
"""

from __future__ import annotations

import cmath
import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.axis import axis_grid, bisect
from tautwave.analysis.exact.polynomials import (
    Poly,
    add,
    divide,
    evaluate,
    even_odd,
    gcd,
    half_planes,
    mirrored,
    multiply,
    positive_roots,
)
from tautwave.analysis.exact.polynomials import scale as scaled
from tautwave.analysis.exact.rational import Complexes, Delayed, Rational, rational
from tautwave.errors import ConfigError

Floats = npt.NDArray[np.float64]
_NEWTON = 60
_FAR = 600.0  # exponent beyond which a root is of no interest, and of no double


class DelayLoop(NamedTuple):
    """Characteristic function now(s) + late(s) exp(-s delay); exact coefficients, delay [s]."""

    now: Poly
    late: Poly
    delay: float

    def __call__(self, s: complex) -> complex:
        """Return the value at s."""
        return _value(self.now, s) + _value(self.late, s) * cmath.exp(-s * self.delay)


class CriticalGain(NamedTuple):
    """A positive gain at which a root is on the axis, and its frequency [rad/s]."""

    gain: float
    frequency: float


def closed_loop(controller: Rational | Delayed, load: Rational) -> DelayLoop:
    """Return the characteristic function of load(s) + controller(s) = 0, both impedances.

    Poles of the controller that its own zeros do not meet stay in: an inner instability counts.
    """
    if isinstance(controller, Rational):
        controller = Delayed(rational([0]), 0.0, controller)
    direct = load + controller.plain
    held = controller.held
    # One s of two springs side by side is not a mode of its own: the least common denominator.
    common = gcd(direct.den, held.den)
    now = multiply(direct.num, divide(held.den, common)[0])
    late = multiply(held.num, divide(direct.den, common)[0])
    return DelayLoop(now, late, controller.delay)


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


def rightmost_roots(loop: DelayLoop, count: int = 4, nodes: int = 24) -> Complexes:
    """Return up to `count` rightmost roots [rad/s] with imaginary part >= 0, rightmost first.

    Parameters
    ----------
    nodes : int
        Chebyshev nodes over the delay; more for roots with |s| delay above about 10.

    Raises
    ------
    ConfigError
        If the loop is not retarded.
    """
    _check_retarded(loop)
    scale = _scale(_floats(loop.now))
    here, there = companion(loop, scale)
    size = len(here)
    if loop.delay == 0.0 or not loop.late:
        guesses = np.linalg.eigvals(here + there)
    else:
        d = _differentiation(nodes) * 2.0 / (loop.delay * scale)
        generator = np.kron(d, np.eye(size))
        generator[:size] = 0.0
        generator[:size, :size] = here
        generator[:size, -size:] = there
        guesses = np.linalg.eigvals(generator)
    order = np.argsort(-guesses.real)
    found: list[complex] = []
    for guess in guesses[order][: 4 * count + 8]:
        root = refine_root(loop, complex(guess) * scale)
        if root.imag >= -1e-9 * scale and not any(abs(root - r) < 1e-7 * abs(r) for r in found):
            found.append(complex(root.real, max(root.imag, 0.0)))
    return np.array(sorted(found, key=lambda r: -r.real)[:count], np.complex128)


def refine_root(loop: DelayLoop, guess: complex) -> complex:
    """Return the root [rad/s] that Newton's method reaches from `guess`, or nan."""
    p, q, delay = _floats(loop.now), _floats(loop.late), loop.delay
    dp, dq = np.polyder(p), np.polyder(q)
    s = guess
    for _ in range(_NEWTON):
        if not cmath.isfinite(s) or -s.real * delay > _FAR:
            return complex(math.nan, math.nan)
        late = cmath.exp(-s * delay)
        value = complex(np.polyval(p, s) + np.polyval(q, s) * late)
        slope = complex(np.polyval(dp, s) + (np.polyval(dq, s) - delay * np.polyval(q, s)) * late)
        if value == 0 or slope == 0:
            break
        step = value / slope
        s -= step
        if abs(step) <= 1e-15 * abs(s):
            break
    size = np.polyval(np.abs(p), abs(s)) + np.polyval(np.abs(q), abs(s)) * abs(late)
    return s if abs(loop(s)) <= 1e-8 * size else complex(math.nan, math.nan)


def companion(loop: DelayLoop, scale: float = 1.0) -> tuple[Floats, Floats]:
    """Return A, B of z' = A z(t) + B z(t - delay), z = (y, y', ...), time in 1/scale [s].

    Shapes (n, n) with n = deg now. Raises ConfigError if the loop is not retarded.
    """
    _check_retarded(loop)
    p, q = _floats(loop.now), _floats(loop.late)
    n = len(p) - 1
    weights = scale ** np.arange(n, dtype=float)  # y^(i) in units of scale**i
    here, there = np.zeros((n, n)), np.zeros((n, n))
    here[np.arange(n - 1), np.arange(1, n)] = 1.0
    top = p[0] * scale**n
    here[-1] = -(p[::-1][:n] * weights) / top
    there[-1, : len(q)] = -(q[::-1] * weights[: len(q)]) / top
    return here, there


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


# -- helpers -------------------------------------------------------------------------------------


def _check_retarded(loop: DelayLoop) -> None:
    if loop.delay > 0.0 and len(loop.late) >= len(loop.now):
        raise ConfigError("the delayed part has to be of lower order than the rest (retarded)")


def _floats(p: Poly) -> Floats:
    return np.array([float(c) for c in p] or [0.0])


def _value(p: Poly, s: complex) -> complex:
    return complex(np.polyval(_floats(p), s))


def _values(p: Floats, q: Floats, delay: float, w: Floats) -> Complexes:
    s = 1j * w
    return np.asarray(np.polyval(p, s) + np.polyval(q, s) * np.exp(-s * delay), np.complex128)


def _or_one(p: Poly) -> Rational:
    return rational(list(p) or [1])


def _scale(p: Floats) -> float:
    """Return a typical size of the roots [rad/s]: their geometric mean, zeros left out."""
    sizes = np.abs(np.roots(p))
    sizes = sizes[sizes > 0.0]
    return float(np.exp(np.mean(np.log(sizes)))) if len(sizes) else 1.0


def _differentiation(n: int) -> Floats:
    """Return the differentiation matrix on cos(pi i/n), i = 0..n (Trefethen 2000, ch. 6)."""
    x = np.cos(math.pi * np.arange(n + 1) / n)
    c = np.where((np.arange(n + 1) % n) == 0, 2.0, 1.0) * (-1.0) ** np.arange(n + 1)
    apart = x[:, None] - x[None, :]
    d = np.outer(c, 1.0 / c) / (apart + np.eye(n + 1))
    return np.asarray(d - np.diag(d.sum(axis=1)))
