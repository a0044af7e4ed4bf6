"""A passive hand that a controller drives unstable: the necessity theorem, made executable.

A controller K(s) that is not positive real is unstable against some passive user. Where its
resistance Re K(jw0) is negative, the user is a mass on a spring and a damper, m s + R + k/s, tuned
to w0 with a little less damping than the controller supplies:

    R = share (-Re K),   m >= 4 |Im K|/w0, 4 |K'(jw0)|,   k = (m w0 + Im K) w0.

Every figure is positive, so the user is passive, and m s + R + k/s + K(s) has a root near jw0 with
positive real part. Where Re K >= 0 on the whole axis but K is unstable by itself, a heavy hand
shows it; where a pole on the axis is multiple or has a residue that is not positive, a root is put
right of that pole; a sampled law is also met near its Nyquist frequency, by a light or a stiff
hand. Each answer is verified: exactly (Routh) for rational K, by the argument principle with a
delay, by the poles of the exact sampled loop for a sampled law.

Source: Berdahl, Smith & Niemeyer claim necessity without proof; the construction is derived here.
SI units.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Iterator
from itertools import chain
from typing import NamedTuple

import numpy as np

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.axis import axis_grid, passivity_margin
from tautwave.analysis.exact.delay_roots import closed_loop, refine_root, rightmost_roots
from tautwave.analysis.exact.polynomials import exact
from tautwave.analysis.exact.positive_real import (
    axis_poles,
    between,
    negative_intervals,
    positive_real,
    resistance,
)
from tautwave.analysis.exact.rational import Delayed, Rational, Sampled, rational
from tautwave.analysis.walls.sampled_user import sampled_root
from tautwave.errors import ConfigError

Controller = Rational | Delayed | Sampled
MIN_MASS = 1e-3
"""Least mass of a constructed hand [kg or kg m**2] unless another is given."""
_DOUBLINGS = 60
_MAX_TURNS = 1000  # of the delay, in a scan for the hand that grows fastest


class User(NamedTuple):
    """Mass [kg or kg m**2], damping [N s/m or N m s/rad], stiffness to ground [N/m or N m/rad]."""

    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0

    def impedance(self) -> Rational:
        """Return m s + R + k/s [N s/m or N m s/rad]."""
        return rational([self.mass, self.damping, self.stiffness], [1, 0])


class Counterexample(NamedTuple):
    """A passive hand and the growing mode it makes with a controller.

    hand : what is added to the device. device : the device's own mass, damping and stiffness.
    root : fastest growing root found [rad/s]. frequency : where it was tuned [rad/s].
    why : one sentence.
    """

    hand: User
    device: User
    root: complex
    frequency: float
    why: str

    @property
    def total(self) -> User:
        """Hand and device together."""
        return User(*(a + b for a, b in zip(self.hand, self.device, strict=True)))

    @property
    def growth_time(self) -> float:
        """Time in which the motion grows e-fold [s]."""
        return 1.0 / self.root.real

    def sentence(self, *, rotary: bool = False) -> str:
        """Return what is printed: the hand, the frequency [Hz] and the growth time [s]."""
        units = ("kg m^2", "N m s/rad", "N m/rad") if rotary else ("kg", "N s/m", "N/m")
        m, r, k = self.hand
        grows = f"grows e-fold every {self.growth_time:.3g} s"
        hz = abs(self.root.imag) / (2.0 * math.pi)
        what = f"the vibration at {hz:.1f} Hz" if hz >= 0.05 else "the motion"
        return (
            f"this controller is unstable with this hand: m = {m:.3g} {units[0]}, "
            f"R = {r:.3g} {units[1]}, k = {k:.4g} {units[2]}; {what} {grows}"
        )


def destabilising_hand(
    controller: Controller,
    frequency: float | None = None,
    *,
    share: float = 0.5,
    device: User | None = None,
    least_mass: float = MIN_MASS,
) -> Counterexample | None:
    """Return a passive hand that the controller drives unstable, verified; None if there is none.

    For rational controllers None is a proof: controller and device together are positive real.
    For delayed ones it means that a scan of the axis found no negative resistance, for sampled ones
    that no single mass on a spring and a damper was found.

    Parameters
    ----------
    controller : Rational, Delayed or Sampled
        Impedance K(s), force over velocity.
    frequency : float, optional
        Where to tune the hand [rad/s]; default: where the motion grows fastest.
    share : float
        Damping of the hand as a share of what the controller supplies, 0 < share < 1.
    device : User, optional
        What always stands between hand and controller; the hand comes on top of it.
    least_mass : float
        Least mass of the hand [kg or kg m**2], > 0.

    Raises
    ------
    ConfigError
        If share or least_mass is out of range, or the resistance at `frequency` is not negative.
    """
    if not 0.0 < share < 1.0 or not least_mass > 0.0:
        raise ConfigError("a hand needs 0 < share < 1 and least_mass > 0")
    device = device or User()
    whole = _with_device(controller, device)
    if frequency is not None:
        if not _value(whole, frequency).real < 0.0:
            raise ConfigError(f"the resistance at {frequency:.6g} rad/s is not negative")
        guesses = _tuned(whole, frequency, share, least_mass)
        why = f"its resistance at {frequency:.6g} rad/s is negative"
    elif isinstance(whole, Rational):
        guesses, frequency, why = _of_rational(whole, share, least_mass)
    else:
        guesses, frequency, why = _of_scan(whole, share, least_mass)
    for hand, guess in guesses:
        root = growing_root(whole, hand, guess)
        if root is not None:
            return Counterexample(hand, device, root, frequency, why)
    return None


def growing_root(controller: Controller, user: User, guess: complex) -> complex | None:
    """Return the fastest growing root found [rad/s] of the loop of user and controller, or None.

    Rational: Routh's count decides; delayed: Newton from `guess` and from the eigenvalues of a
    Chebyshev discretisation; sampled: poles of the exact sampled loop.
    """
    if isinstance(controller, Sampled):
        return sampled_root(controller, *user)
    loop = closed_loop(controller, user.impedance())
    roots = [refine_root(loop, guess)]
    if isinstance(controller, Rational):
        total = poly.add(loop.now, loop.late)
        if not poly.half_planes(total).right:
            return None
        roots += [refine_root(loop, complex(r)) for r in np.roots([float(c) for c in total])]
        # Growth below rounding is still growth: Routh's count has shown it.
        shown = _fastest(roots) or guess
        return complex(max(shown.real, math.ulp(abs(shown))), abs(shown.imag))
    if len(loop.late) < len(loop.now):
        roots += [complex(s) for s in rightmost_roots(loop, 2)]
    best = _fastest(roots)
    return complex(best.real, abs(best.imag)) if best is not None and best.real > 0.0 else None


def _fastest(roots: list[complex]) -> complex | None:
    known = [s for s in roots if cmath.isfinite(s)]
    return max(known, key=lambda s: s.real) if known else None


# -- where to put the hand -----------------------------------------------------------------------

Guesses = Iterator[tuple[User, complex]]


def _of_rational(k: Rational, share: float, least: float) -> tuple[Guesses, float, str]:
    decision = positive_real(k)
    if decision.positive_real:
        return iter(()), 0.0, decision.reason
    if decision.unstable_poles:
        pole = max(k.poles(), key=lambda p: p.real)
        return _heavy(k, complex(pole), least), abs(complex(pole).imag), decision.reason
    if decision.negative:
        where = _quickest(k, *_band(k), share, least)
        if where is None:
            where = passivity_margin(k).resistance_frequency
        if not 0.0 < where < math.inf:
            low, high = negative_intervals(resistance(k)[0])[0]
            where = math.sqrt(float(between(low, high)))
        return _tuned(k, where, share, least), where, decision.reason
    pole_at = next(p.frequency for p in axis_poles(k) if not p.allowed)
    return _beside(k, pole_at), pole_at, decision.reason


def _of_scan(k: Delayed | Sampled, share: float, least: float) -> tuple[Guesses, float, str]:
    inner = _inner_poles(k)
    if len(inner) and inner.real.max() > 0.0:
        pole = complex(inner[np.argmax(inner.real)])
        return _heavy(k, pole, least), abs(pole.imag), "it is unstable by itself"
    where = _quickest(k, *_band(k), share, least)
    light = _at_nyquist(k, share, least) if isinstance(k, Sampled) else iter(())
    if where is None:
        nyquist = math.pi / k.period if isinstance(k, Sampled) else 0.0
        return light, nyquist, "it supplies energy at its Nyquist frequency"
    why = f"its resistance is {k(1j * where).real:.4g} at {where:.6g} rad/s"
    return chain(_tuned(k, where, share, least), light), where, why


def _quickest(k: Controller, low: float, high: float, share: float, least: float) -> float | None:
    """Return the frequency [rad/s] whose tuned hand grows fastest, to first order; or None."""
    w = axis_grid(k, low, high)
    values = k.at(np.asarray(1j * w))
    if not (values.real < 0.0).any():
        return None
    turn = np.abs(np.gradient(values, w))
    mass = np.maximum(np.maximum(least, 4.0 * np.abs(values.imag) / w), 4.0 * turn)
    growth = (1.0 - share) * -values.real / (2.0 * mass + values.imag / w + turn)
    return float(w[np.argmax(growth)])


def _at_nyquist(k: Sampled, share: float, least: float) -> Guesses:
    """Yield hands for a law that supplies energy at z = -1: light dampers, then stiff springs.

    A damper alone meets Colgate's bound (T/2) law(-1) exactly; with a mass that cannot be left
    out, a spring that tunes it to the Nyquist frequency meets 8/pi**2 of it.
    """
    nyquist = math.pi / k.period
    supply = 0.5 * k.period * k.law(-1.0).real
    damping = supply - k.device[1]
    guess = complex(0.1 * nyquist, nyquist)
    if damping > 0.0:
        for mass in (least, 0.0) if k.device[0] > 0.0 else (least,):
            yield User(mass, share * damping, 0.0), guess
    damping = 8.0 / math.pi**2 * supply - k.device[1]
    mass = least
    for _ in range(_DOUBLINGS if damping > 0.0 else 0):
        stiffness = (mass + k.device[0]) * nyquist**2 - k.device[2]
        if stiffness > 0.0:
            yield User(mass, share * damping, stiffness), guess
        mass *= 2.0


def _tuned(k: Controller, w: float, share: float, least: float) -> Guesses:
    """Yield hands tuned to w, heavier and heavier: the heavier, the closer the root to jw."""
    value, slope = _value(k, w), k.slope(1j * w)
    mass = max(least, 4.0 * abs(value.imag) / w, 4.0 * abs(slope))
    for _ in range(_DOUBLINGS):
        stiffness = (mass * w + value.imag) * w
        growth = (1.0 - share) * -value.real / abs(mass + stiffness / w**2 + slope)
        yield User(mass, -share * value.real, stiffness), complex(growth, w)
        mass *= 2.0


def _heavy(k: Controller, pole: complex, least: float) -> Guesses:
    """Yield heavier and heavier hands: the loop's roots go to the controller's own poles."""
    near = 1e-4 * abs(pole)
    residue = abs(k(pole + near)) * near
    mass = max(least, 4.0 * residue / abs(pole) ** 2)
    for _ in range(_DOUBLINGS):
        yield User(mass, 0.1 * mass * abs(pole), 0.0), pole
        mass *= 2.0


def _beside(k: Rational, pole: float) -> Guesses:
    """Yield hands that put a root exactly at a point right of a pole on the axis, or far out.

    m s + R + k/s takes any value in the cone of s, 1 and 1/s, which near the axis is almost the
    whole right half-plane: the point is chosen where -K is in it.
    """
    size = pole if 0.0 < pole < math.inf else _size(k, far=pole == math.inf)
    for ratio in (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6):
        for degrees in sorted(range(-80, 85, 5), key=abs):
            turn = cmath.exp(1j * math.radians(degrees))
            s = size / ratio * turn if pole == math.inf else size * ratio * turn
            if pole != math.inf:
                s += 1j * pole
            hand = _through(s, -k(s)) if s.imag >= 0.0 else None
            if hand is not None:
                yield hand, s


def _through(s: complex, value: complex) -> User | None:
    """Return a passive m s + R + k/s that has `value` at s, or None."""
    a, b, x, w = value.real, value.imag, s.real, s.imag
    if not a > 0.0:
        return None
    if abs(w) < 1e-9 * abs(s):
        return User(0.25 * a / x, 0.5 * a, 0.25 * a * x)
    low, high = max(0.0, b / w), (a + b * x / w) / (2.0 * x)
    if not low < high:
        return None
    mass = 0.5 * (low + high)
    return User(mass, a - 2.0 * mass * x + b * x / w, (mass - b / w) * abs(s) ** 2)


# -- helpers -------------------------------------------------------------------------------------


def _with_device(k: Controller, device: User) -> Controller:
    if not any(device):
        return k
    if isinstance(k, Sampled):
        return k.with_device(*device)
    own = rational([device.mass, device.damping, device.stiffness], [1, 0])
    return k + own if isinstance(k, Rational) else Delayed(k.held, k.delay, k.plain + own)


def _value(k: Controller, w: float) -> complex:
    """Return K(jw), for a rational K with an exact real part: it may be tiny beside the other."""
    value = k(1j * w)
    if isinstance(k, Rational):
        top, bottom = resistance(k)
        x = exact(w) ** 2
        value = complex(float(poly.evaluate(top, x) / poly.evaluate(bottom, x)), value.imag)
    return value


def _inner_poles(k: Delayed | Sampled) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    if isinstance(k, Delayed):
        return np.concatenate([k.held.poles(), k.plain.poles()])
    poles = k.law.poles()
    outside = poles[np.abs(poles) > 1.0 + 1e-9]
    return np.asarray(np.log(outside) / k.period, np.complex128)


def _band(k: Controller) -> tuple[float, float]:
    if isinstance(k, Sampled):
        return 1e-4 / k.period, math.pi / k.period
    sizes = np.abs(k.features())
    sizes = sizes[sizes > 0.0]
    if isinstance(k, Rational):
        return 1e-3 * float(sizes.min(initial=1.0)), 1e3 * float(sizes.max(initial=1.0))
    turn = 4.0 * math.pi / k.delay
    high = max(turn, min(4.0 * float(sizes.max(initial=0.0)), _MAX_TURNS * turn))
    return min(1e-3 * float(sizes.min(initial=turn)), 1e-3 * turn), high


def _size(k: Rational, *, far: bool) -> float:
    """Return a frequency [rad/s] beyond (or below) every zero and pole off zero."""
    sizes = np.abs(k.features())
    sizes = sizes[sizes > 0.0]
    if not len(sizes):
        return 1.0
    return float(sizes.max() if far else sizes.min())
