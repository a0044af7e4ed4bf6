"""Roots of p(s) + q(s) exp(-s delay), the rightmost ones.

A linear loop with a pure delay has such a characteristic function. With deg q < deg p (retarded)
only finitely many roots lie right of any line; they are found as eigenvalues of a Chebyshev
discretisation, refined by Newton.

Sources: Michiels & Niculescu, Stability and Stabilization of Time-Delay Systems, 2007; Breda,
Maset & Vermiglio, SIAM J. Sci. Comput. 27, 2005 (Chebyshev). Units: s in rad/s, delays in s.
"""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.polynomials import (
    Poly,
    divide,
    gcd,
    multiply,
)
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
    roots: list[complex] = []
    for guess in guesses[order][: 4 * count + 8]:
        root = refine_root(loop, complex(guess) * scale)
        if root.imag >= -1e-9 * scale and not any(abs(root - r) < 1e-7 * abs(r) for r in roots):
            roots.append(complex(root.real, max(root.imag, 0.0)))
    return np.array(sorted(roots, key=lambda r: -r.real)[:count], np.complex128)


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


# -- helpers -------------------------------------------------------------------------------------


def _check_retarded(loop: DelayLoop) -> None:
    if loop.delay > 0.0 and len(loop.late) >= len(loop.now):
        raise ConfigError("the delayed part has to be of lower order than the rest (retarded)")


def _floats(p: Poly) -> Floats:
    return np.array([float(c) for c in p] or [0.0])


def _value(p: Poly, s: complex) -> complex:
    return complex(np.polyval(_floats(p), s))


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
