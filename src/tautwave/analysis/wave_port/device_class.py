"""Does a port return more of a wave than arrives on any device of a class? A proof, or where.

A class is given by what is sure of the impedance Z = R + jX that the motor feels, device, hand and
environment together, at every frequency w > 0:

    R >= d,   X >= m w - K / w.

It holds every parallel mass >= m, damper >= d and spring <= K, and any passive network beside them
that is nowhere stiffer than the spring. The port sees a device through a held effort and through
mean velocities over a period. Both are averages over the same period, so that the sampled
admittance is a weighted mean of the true one at the frequencies which the sampling folds together,

    Y*(theta) = sum_n s_n Y(j w_n),  w_n = (theta + 2 pi n) / T,  s_n = sinc(w_n T / 2)**2,

and sum s_n = 1: a parallel device under a held effort is in it exactly, not through a bilinear
approximation. The returned wave is a Moebius map of Y*, S = (A Y* + B) / (C Y* + E), known exactly
(`reflection`); that |H S| <= 1 for all of Y* and theta is proved cell by cell (`contraction`). No
device and no frequency is sampled. The class holds Y* = 0, so that each device can be stiffened
into a locked lever within it, on which C Y* + E has no zero on the circle: stable on the locked
lever, which Schur's test decides, is stable on the class.

Sources: the weights are those of Colgate & Schenkel 1997 for a held wall, applied to the
device; the rest is derived here.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.wave_port.contraction import Folded, Outcome, not_refused, prove
from tautwave.analysis.wave_port.reflection import Reflection, reflection
from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams

Float = npt.NDArray[np.float64]

ROUNDED = 1e-15
"""Share by which the class is taken larger than stated, for the rounding of its numbers."""

POINTS = np.geomspace(1e-4, math.pi, 96)
"""Frequencies at which a gain is computed; a guide, never a proof."""

SHARPLY = np.geomspace(0.1, 1e3, 14)
"""Distances from the class' resonance, in its widths, of further such frequencies."""

STEPS, NEAR_STEPS = 14, 7
RETREAT = (0.999, 0.99, 0.97, 0.9, 0.8, 0.6, 0.4, 0.2, 0.1, 0.01)
"""Shares of the stiffest spring that points suggest, at which a proof is tried."""


class DeviceClass(NamedTuple):
    """What is sure of a device: least mass [kg m**2 or kg], least damping [N m s/rad or N s/m].

    stiffness: greatest spring to ground [N m/rad or N/m], grip and environment together.
    """

    mass: float
    damping: float
    stiffness: float


DAMPER_AS_SPRING = 1.45
"""Above 4 sin(x / 2)**2 / x for every x."""


def wall_spring(stiffness: float, damping: float, period: float) -> float:
    """Return the spring [N m/rad or N/m] that is nowhere softer than a sampled wall.

    A wall K + B w held for a period has a springlike reactance of at most (K T / 2) / sin(x / 2)
    + B at x = w T, however late it acts and whatever filter w passes; a spring folded by sampling
    has K T x / (2 sin(x / 2))**2 of it.
    """
    return stiffness + DAMPER_AS_SPRING * abs(damping) / period


LATEST = 16
"""Greatest command delay [periods] that is tried: the proof's polynomials grow with it, and a port
that late is hardly ever contracting."""


class ClassGain(NamedTuple):
    """How much of a wave may return over a class [1].

    greatest: 1 where that is proved (standing, all returns), else what a device of the class was
    found to return, at theta = w T.
    """

    greatest: float
    theta: float
    contracting: bool


def class_gain(
    p: PortParams, observer: ObserverParams, delay_periods: int, devices: DeviceClass
) -> ClassGain:
    """Return that |H S| <= 1 over a class of devices is proved, or the gain that was found.

    Parameters
    ----------
    p, observer : PortParams, ObserverParams
        The port.
    delay_periods : int
        Whole periods until a command acts.
    devices : DeviceClass
        The class; damping > 0.
    """
    if delay_periods > LATEST:
        return ClassGain(math.inf, math.pi, False)
    r = reflection(p, observer, delay_periods)
    proof = _proof(p, observer, delay_periods, devices)
    if proof.proved:
        return ClassGain(1.0, 0.0, True)
    if not r.locked:
        return ClassGain(math.inf, math.pi, False)
    theta = POINTS if math.isnan(proof.theta) else np.append(POINTS, proof.theta)
    gains = _reached(r, _folded(p, devices), theta)
    worst = int(np.argmax(gains))
    return ClassGain(max(float(gains[worst]), 1.0), float(theta[worst]), False)


def contracting(
    p: PortParams, observer: ObserverParams, delay_periods: int, devices: DeviceClass
) -> bool:
    """Return whether |H S| <= 1 over a class of devices is proved."""
    return delay_periods <= LATEST and _proof(p, observer, delay_periods, devices).proved


@functools.lru_cache(maxsize=256)
def _proof(
    p: PortParams, observer: ObserverParams, delay_periods: int, devices: DeviceClass
) -> Outcome:
    return prove(reflection(p, observer, delay_periods), _folded(p, devices))


def stiffest_spring(
    p: PortParams, observer: ObserverParams, delay_periods: int, devices: DeviceClass
) -> float:
    """Return the stiffest spring [N m/rad or N/m] up to which `class_gain` proves contraction.

    `devices.stiffness` is not used. 0 if there is none.
    """
    guide = suggested_spring(p, observer, delay_periods, devices)
    r, refused = reflection(p, observer, delay_periods), POINTS[:0]
    for share in RETREAT if guide > 0.0 and delay_periods <= LATEST else ():
        tried = devices._replace(stiffness=share * guide)
        # Where one proof failed the next will, unless the spring is soft enough there.
        if not not_refused(r, _folded(p, tried), refused):
            continue
        proof = _proof(p, observer, delay_periods, tried)
        if proof.proved:
            return tried.stiffness
        refused = np.array([proof.theta] if proof.theta > 0.0 else [])
    return 0.0


def suggested_spring(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    devices: DeviceClass,
    from_: float = 0.0,
    to: float = math.inf,
) -> float:
    """Return the stiffest spring within a range at which no frequency of a grid objects."""
    r = reflection(p, observer, delay_periods)

    width = np.maximum(0.5 * devices.damping * p.period / devices.mass, 1e-6) * SHARPLY

    def fine(stiffness: float) -> bool:
        swing = p.period * math.sqrt(stiffness / devices.mass)
        near = np.concatenate([POINTS, swing - width, swing + width])
        near = near[(near >= POINTS[0]) & (near <= math.pi)]
        return not_refused(r, _folded(p, devices._replace(stiffness=stiffness)), near)

    if not r.locked or not fine(from_):
        return 0.0
    # Nothing is stiffer than what swings at half the rate with the least mass.
    high = min(to, devices.mass * (math.pi / p.period) ** 2)
    low = max(from_, 1e-9 * high)
    if low > from_ and not fine(low):
        return from_
    for _ in range(STEPS if from_ == 0.0 else NEAR_STEPS):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if fine(middle) else (low, middle)
    return low


def _folded(p: PortParams, devices: DeviceClass) -> Folded:
    less, more = 1.0 - ROUNDED, 1.0 + ROUNDED
    return Folded(
        devices.mass / p.period * less, devices.damping * less, devices.stiffness * p.period * more
    )


def _reached(r: Reflection, device: Folded, theta: Float) -> Float:
    """Return the greatest |H S| at each theta that devices of the class were found to reach.

    With the class' least reactance or more and its least resistance or more at the frequency
    itself, and locked at those folded into it.
    """
    spread = np.geomspace(1e-3, 1e3, 40)
    resistance = device.damping * np.concatenate([[1.0], 1.0 + spread])[:, None, None]
    edge = device.mass * theta - device.stiffness / theta
    # From the least upwards, and finely about resonance where the class has it.
    about = device.damping * np.concatenate([-spread, [0.0], spread])[:, None]
    above = edge + np.concatenate([[0.0], device.mass * spread])[:, None]
    reactance = np.concatenate([above, np.maximum(about, edge)])
    y = np.sinc(0.5 * theta / math.pi) ** 2 / (resistance + 1j * reactance)
    excess, leaving = (
        curve * np.abs(y) ** 2 + 2.0 * (slope * y).real + rest for curve, slope, rest in r.at(theta)
    )
    arriving = np.maximum(excess + leaving, 1e-30 * leaving)
    gains: Float = np.sqrt(np.max(leaving / arriving, axis=(0, 1)))
    return gains
