"""How much of a wave a port returns on the worst device of a class, frequency by frequency.

A class is given by what is sure of the impedance Z = R + jX that the motor feels, device, hand and
environment together, at every frequency w > 0:

    R >= d,   X >= m w - K / w.

It holds every parallel mass >= m, damper >= d and spring <= K, and any passive network beside them
that is nowhere softer than the spring. The port sees a device through a held effort and through
mean velocities over a period. Both are averages over the same period, so that the sampled
admittance is a weighted mean of the true one at the frequencies which the sampling folds together,

    Y*(theta) = sum_n s_n Y(j w_n),  w_n = (theta + 2 pi n) / T,  s_n = sinc(w_n T / 2)**2,

and sum s_n = 1. At each w_n the class allows the part of the disc |Y - 1/(2d)| <= 1/(2d) with
X >= m w - K/w, another disc; the weighted sum of their convex hulls is a convex set known by its
support function, with corners, arcs and all.

The returned wave is a Moebius map of Y*: S = (A Y* + B) / (C Y* + E). Hence |H S| > 1 inside (or
outside) one disc of Y*, and the port is contracting on the whole class exactly as far as that disc
and the convex set do not meet: a line that separates them proves it. No device is sampled. The set
holds Y = 0, so that each device can be stiffened into a locked lever within it, on which C Y + E
has no zero on the circle: stable on the locked lever is stable on the class.

Sources: the weights are those of Colgate & Schenkel 1997 for a held wall, applied to the
device; the rest is derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.wave_port.sensor_noise import observer_response
from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams

Complex = npt.NDArray[np.complex128]
Float = npt.NDArray[np.float64]

FOLDS = 6
"""Frequencies folded in on each side; the rest is bounded as one."""

DIRECTIONS = 96
NARROWINGS = 14
LOWEST = 5e-4
"""Least theta of the grid: from 1e-2 down the gain is 1 - c theta**2, of one sign."""

TURNS = 2048
"""Frequencies at which the port on a locked lever is followed round the circle."""

TOLERANCE = 1e-9
"""Excess of a gain over 1 that is rounding."""


class DeviceClass(NamedTuple):
    """What is sure of a device: least mass [kg m**2 or kg], least damping [N m s/rad or N s/m].

    stiffness: greatest spring to ground [N m/rad or N/m], grip and environment together.
    """

    mass: float
    damping: float
    stiffness: float


class ClassGain(NamedTuple):
    """Greatest share of a wave returned over a class [1], and the theta = w T where it is."""

    greatest: float
    theta: float

    @property
    def contracting(self) -> bool:
        """Whether no wave leaves larger than it came, to rounding."""
        return self.greatest <= 1.0 + TOLERANCE


class Moebius(NamedTuple):
    """S = (a Y + b) / (c Y + e) per frequency, and the filter's |H|**2; each of shape (n,)."""

    a: Complex
    b: Complex
    c: Complex
    e: Complex
    low_pass: Float


def returned_wave(
    p: PortParams, observer: ObserverParams, delay_periods: int, theta: Float
) -> Moebius:
    """Return what a port makes of a wave, as a map of the sampled admittance at e^(j theta)."""
    z = np.exp(1j * theta)
    q = 1.0 / z
    x, by_effort = observer_response(observer, theta)
    lead, b = p.period * p.lead, p.impedance
    late = q**delay_periods
    under_way = sum((q**at for at in range(1, delay_periods + 1)), np.zeros_like(q))
    # predicted mean velocity of the acting period, per true velocity and per effort
    by_velocity = late * (x[1] + lead * x[2]) * p.period / (z - 1.0)
    fed = late * (by_effort[1] + lead * by_effort[2]) - p.half_mobility * (1.0 + 2.0 * under_way)
    sent_velocity, sent_fed = x[0], (z - 1.0) / p.period * by_effort[0]
    slipped = b * p.slip
    low_pass = p.filter_gain / np.abs(1.0 - (1.0 - p.filter_gain) * q)
    return Moebius(
        a=2.0 * b * sent_velocity - b * by_velocity,
        b=b * fed - 2.0 * b * sent_fed - (1.0 - slipped),
        c=b * by_velocity,
        e=1.0 + slipped - b * fed,
        low_pass=low_pass * low_pass,
    )


def class_gain(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    devices: DeviceClass,
    theta: Float | None = None,
) -> ClassGain:
    """Return the greatest |H S| over a class of devices.

    Parameters
    ----------
    p, observer : PortParams, ObserverParams
        The port.
    delay_periods : int
        Whole periods until a command acts.
    devices : DeviceClass
        The class; damping > 0.
    theta : ndarray of shape (n,), optional
        Frequencies w T in (0, pi); a grid that is fine where it matters, if None.
    """
    if theta is None:
        theta = frequencies(p.period, devices)
    if not stable_when_locked(p, observer, delay_periods):
        return ClassGain(math.inf, math.pi)
    s = returned_wave(p, observer, delay_periods, theta)
    # |c Y + e|**2 - |H|**2 |a Y + b|**2 = curve |Y|**2 + 2 Re(slope Y) + rest >= 0
    curve = np.abs(s.c) ** 2 - s.low_pass * np.abs(s.a) ** 2
    slope = s.c * np.conj(s.e) - s.low_pass * s.a * np.conj(s.b)
    rest = np.abs(s.e) ** 2 - s.low_pass * np.abs(s.b) ** 2
    centre = -np.conj(slope) / curve
    square = np.abs(centre) ** 2 - rest / curve
    inside = curve < 0.0  # then the disc is where the port contracts
    distance, point = _distances(p.period, devices, theta, centre, inside)
    excess = curve * (square - distance * np.abs(distance))
    gain = 1.0 + excess / np.abs(s.c * point + s.e) ** 2
    worst = int(np.argmax(gain))
    return ClassGain(math.sqrt(max(float(gain[worst]), 0.0)), float(theta[worst]))


def stable_when_locked(p: PortParams, observer: ObserverParams, delay_periods: int) -> bool:
    """Return whether a port is stable on a lever that cannot move.

    Its poles are the zeros of E, which has none of its own outside the circle: E goes round zero
    as often as it has zeros there.
    """
    theta = 2.0 * math.pi * (np.arange(TURNS) + 0.5) / TURNS
    locked = returned_wave(p, observer, delay_periods, theta).e
    turns = np.angle(np.roll(locked, -1) / locked)
    return bool(np.max(np.abs(turns)) < 0.5 * math.pi and abs(float(np.sum(turns))) < math.pi)


def frequencies(period: float, devices: DeviceClass) -> Float:
    """Return a grid of theta in (0, pi), dense at the class' resonance."""
    grid = [np.geomspace(LOWEST, 0.05, 60), np.linspace(0.05, math.pi - 1e-6, 320)]
    swing = period * math.sqrt(devices.stiffness / devices.mass)
    width = max(0.5 * devices.damping * period / devices.mass, 1e-6)
    near = swing + width * np.concatenate([-np.geomspace(0.05, 40, 24), np.geomspace(0.05, 40, 24)])
    grid.append(near[(near > LOWEST) & (near < math.pi)])
    return np.unique(np.concatenate(grid))


def support(devices: DeviceClass, frequency: Float, direction: Complex) -> Float:
    """Return how far the admittances that a class allows reach in a direction [1/(N s/m) ...].

    Parameters
    ----------
    devices : DeviceClass
        The class.
    frequency : ndarray
        w > 0 [rad/s], broadcast with `direction`.
    direction : ndarray of complex
        Of length 1.
    """
    radius = 0.5 / devices.damping
    reactance = devices.mass * frequency - devices.stiffness / frequency
    corner = 1.0 / (devices.damping + 1j * reactance)
    best = np.maximum(0.0, (np.conj(direction) * corner).real)
    on_disc = radius + radius * direction  # where the damper's disc reaches farthest
    size = 0.5 / np.maximum(np.abs(reactance), 1e-300)
    heavy = reactance > 0.0
    other = np.where(heavy, -1j, 1j) * size
    apart = np.abs(on_disc - other)
    allowed = np.where(heavy, apart <= size * (1.0 + 1e-12), apart >= size)
    best = np.where(allowed, (np.conj(direction) * on_disc).real, best)
    on_other = other + size * direction
    allowed = heavy & (np.abs(on_other - radius) <= radius * (1.0 + 1e-12))
    return np.where(allowed, np.maximum(best, (np.conj(direction) * on_other).real), best)


def sampled_support(period: float, devices: DeviceClass, theta: Float, direction: Complex) -> Float:
    """Return how far the sampled admittances of a class reach; shapes (n, 1) and (n, k)."""
    reach = np.zeros(np.broadcast(theta, direction).shape)
    taken = np.zeros(theta.shape)
    for at in range(-FOLDS, FOLDS + 1):
        angle = theta + 2.0 * math.pi * at
        weight = (np.sin(0.5 * angle) / (0.5 * angle)) ** 2
        facing = direction if at >= 0 else np.conj(direction)
        reach = reach + weight * support(devices, np.abs(angle) / period, facing)
        taken = taken + weight
    # All that is folded in from higher up is at most this long, whatever its direction.
    beyond = (2.0 * math.pi * (FOLDS + 0.5)) / period
    longest = 1.0 / max(devices.mass * beyond - devices.stiffness / beyond, devices.damping)
    return reach + (1.0 - taken) * longest


def _distances(
    period: float,
    devices: DeviceClass,
    theta: Float,
    centre: Complex,
    inside: npt.NDArray[np.bool_],
) -> tuple[Float, Complex]:
    """Return, per theta, how far the class stays away from a point, and where it is nearest.

    Where `inside`, how far it reaches away from the point, and where it is farthest. Negative: the
    point is in the class.
    """
    row = theta[:, None]
    angle = np.tile(np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False), (len(theta), 1))
    step = 2.0 * math.pi / DIRECTIONS
    sign = np.where(inside, -1.0, 1.0)[:, None]
    best = np.zeros((len(theta), 1))
    value = np.zeros((len(theta), 1))
    for at in range(NARROWINGS):
        direction = np.exp(1j * angle)
        along = (np.conj(direction) * centre[:, None]).real
        # nearest: the best separating line; farthest: the largest reach
        gap = sign * (along - sampled_support(period, devices, row, direction)) * sign
        choose = np.argmax(sign * gap, axis=1)[:, None]
        best = np.take_along_axis(angle, choose, axis=1)
        value = np.take_along_axis(gap, choose, axis=1)
        step = step if at == 0 else step / 3.0
        angle = best + step * np.linspace(-1.0, 1.0, 7)[None, :]
    direction = np.exp(1j * best[:, 0])
    distance = np.where(inside, -value[:, 0], value[:, 0])
    point = centre - np.where(inside, -distance, distance) * direction
    return distance, point
