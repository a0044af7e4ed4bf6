"""The worked example on a real sampler: how far k_c may go, by discretisation of the resonator.

The hand's position is sampled, the controller (resonator on its coupling spring, driven by that
position) advances by one of four schemes, its force comes `delay` samples later and is held. The
loop is exact: hand by its exact motion, stability by roots of the polynomial in z.

Schemes: `zoh` and `foh`, exact for a held or a linearly interpolated position; `tustin`,
trapezoidal; `cordis`, explicit mass-interaction (Verlet position, backward difference for the
damper) whose new position is used at once. CORDIS-ANIMA's own order, with the object's position a
sample older, is `cordis_late`. Source: Cadoz, Luciani & Florens 1993; recomputed. SI units.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.rational import Complexes
from tautwave.errors import ConfigError
from tautwave.models.linear import flow_rows
from tests.lab.papers.resonator_loop import COUPLING, HAND, RESONATOR, Oscillator

Floats = npt.NDArray[np.float64]
Scheme = Literal["zoh", "foh", "tustin", "cordis", "cordis_late"]


class Boundary(NamedTuple):
    """A coupling k_c [N/m] at which the sampled loop gains or loses stability, and the angle.

    frequency_hz [Hz] of the pole on the unit circle; `stable_above`: whether it gains it.
    """

    coupling: float
    frequency_hz: float
    stable_above: bool


def sampled_law(
    period: float,
    scheme: Scheme,
    coupling: float = COUPLING,
    resonator: Oscillator = RESONATOR,
) -> tuple[Floats, Floats]:
    """Return numerator and denominator of force over position [N/m] in z, highest power first.

    Parameters
    ----------
    period : float
        T [s].
    scheme : str
        One of `Scheme`.
    coupling : float
        k_c [N/m].

    Raises
    ------
    ConfigError
        If the scheme has no such name.
    """
    m, r, k = (float(x) for x in resonator)
    follow, den = _follow(period, scheme, coupling, m, r, k + coupling)
    num = coupling * np.polysub(den, coupling * follow)
    return np.asarray(num, np.float64), den


def sampled_hand(period: float, hand: Oscillator = HAND) -> tuple[Floats, Floats]:
    """Return numerator and denominator of position over held force [m/N] in z (exact)."""
    return held_oscillator(period, *(float(x) for x in hand))[:2]


def sampled_poles(
    coupling: float,
    period: float,
    scheme: Scheme,
    delay: int = 0,
    hand: Oscillator = HAND,
    resonator: Oscillator = RESONATOR,
) -> Complexes:
    """Return the closed loop's poles in z, `delay` samples late."""
    num, den = sampled_law(period, scheme, coupling, resonator)
    top, bottom = sampled_hand(period, hand)
    late = np.concatenate([np.polymul(den, bottom), np.zeros(delay)])
    return np.asarray(np.roots(np.polyadd(late, np.polymul(num, top))), np.complex128)


def sampled_boundaries(
    period: float,
    scheme: Scheme,
    delay: int = 0,
    low: float = 500.0,
    high: float = 40_000.0,
    points: int = 400,
) -> list[Boundary]:
    """Return the couplings in [low, high] N/m where stability changes, rising.

    A region narrower than the `points`-th part of the decades between low and high may be missed;
    the ends found are exact to 1e-12.
    """
    grid = np.geomspace(low, high, points)
    growth = [_growth(k, period, scheme, delay) for k in grid]
    found = []
    for i in range(points - 1):
        if (growth[i] < 0.0) != (growth[i + 1] < 0.0):
            a, b = float(grid[i]), float(grid[i + 1])
            for _ in range(45):
                middle = 0.5 * (a + b)
                same = (_growth(middle, period, scheme, delay) < 0.0) == (growth[i] < 0.0)
                a, b = (middle, b) if same else (a, middle)
            poles = sampled_poles(b, period, scheme, delay)
            angle = abs(np.angle(poles[np.argmax(np.abs(poles))]))
            hz = float(angle) / (2.0 * math.pi * period)
            found.append(Boundary(0.5 * (a + b), hz, growth[i] >= 0.0))
    return found


def held_oscillator(
    period: float, mass: float, damping: float, stiffness: float
) -> tuple[Floats, Floats, Floats]:
    """Return numerator (held force), denominator and numerator (interpolated force), all in z.

    Position over force [m/N]; the interpolated one reaches the next sample's force, so it has
    direct feedthrough. The motion between samples is exact (`tautwave.models.linear`).
    """
    xv, xn, xs, vv, vn, vs = flow_rows(stiffness, damping, mass, period)[:6]
    f = np.array(
        [
            [1.0 - stiffness * xn, xv - damping * xn],
            [-stiffness * vn, 1.0 + vv - damping * vn],
        ]
    )
    held, ramp = np.array([xn, vn]), np.array([xs, vs]) / period
    den = np.array([1.0, -f[0, 0] - f[1, 1], f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]])

    def position(b: Floats) -> Floats:
        return np.array([0.0, b[0], f[0, 1] * b[1] - f[1, 1] * b[0]])

    linear = position(f @ ramp + held - ramp) + ramp[0] * den
    return position(held), den, linear


# -- helpers -------------------------------------------------------------------------------------


def _follow(
    period: float, scheme: Scheme, coupling: float, m: float, r: float, k: float
) -> tuple[Floats, Floats]:
    """Return the object's position per coupling force: num, den of 1/(m s**2 + r s + k) in z."""
    if scheme in ("zoh", "foh"):
        held, den, linear = held_oscillator(period, m, r, k)
        return (held if scheme == "zoh" else linear), den
    if scheme == "tustin":
        a = 2.0 / period
        den = m * a * a * np.array([1.0, -2.0, 1.0]) + r * a * np.array([1.0, 0.0, -1.0])
        return np.array([1.0, 2.0, 1.0]), den + k * np.array([1.0, 2.0, 1.0])
    stiff, loss = k * period**2 / m, r * period / m
    den = np.array([1.0, stiff + loss - 2.0, 1.0 - loss])
    if scheme == "cordis":
        return np.array([period**2 / m, 0.0]), den
    if scheme == "cordis_late":
        return np.array([period**2 / m]), den
    raise ConfigError(f"there is no scheme {scheme}; there are zoh, foh, tustin, cordis")


def _growth(coupling: float, period: float, scheme: Scheme, delay: int) -> float:
    return float(np.abs(sampled_poles(coupling, period, scheme, delay)).max()) - 1.0
