"""A damper in a motor, as a law that is sampled much slower finds it.

A motor's own loop, of period t, holds u = kd w for t, w its filtered velocity. On a device of
viscous damping b, whose hand is any passive one, positions x_k at the motor's samples have

    sum u^h_k dx_k >= (1/t) sum over frequencies of d(phi) |dx(phi)|^2 - E0,
    d(phi) = b - L(phi),    L(phi) = (t/2) [Re E - cot(phi/2) Im E],

u^h what the host adds, E0 what was stored, E the damper's pulse transfer: Colgate and Schenkel's
condition, read backwards. At low frequencies L is -kd; near the loop's own rate it is above 0, so
the damper takes from b there, and d > 0 everywhere is what it needs.

The host holds its effort for T = N t, so it meets only the sums dX of N dx. Of them, with the
sum's |S(phi)|^2 = sin^2(theta/2) / sin^2(phi/2) at the N angles phi = (theta + 2 pi n) / N that
fall on theta, Cauchy and Schwarz give |dX|^2 <= (1/N^2) [sum |S|^2 / d] [sum d |dx|^2], so that

    sum u^h_j dX_j >= (1/T) sum over frequencies of D(theta) |dX(theta)|^2 - E0,
    D(theta) = N^2 / sum over n of |S_n|^2 / d_n:

D takes the place of b in the condition of a law that is sampled at T, frequency by frequency. It is
b + kd for slow motion. A filter costs more of it than its lag: a passive hand may move between the
host's samples where the damper is weak. Where an effort comes to act within a period there are more
sums than one; then only the least d counts.

Sources: Colgate & Schenkel, J. Robotic Systems 14(1), 1997; the step to a slower law: derived here.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.bounds import reduce_fraction
from tautwave.analysis.walls.passivity import leak_form, needed_damping, wall_leak
from tautwave.analysis.walls.sampled import SampledWall, split_delay, velocity_gain, wall_transfer
from tautwave.types import Damper

Floats = npt.NDArray[np.float64]

THETA = np.concatenate([np.geomspace(1e-4, 0.02, 48), np.linspace(0.02, math.pi, 400)[1:]])
"""Angles of the host's law at which the condition is seen to hold."""
MARGIN = 1e-3
"""Relative, kept for what lies between these angles."""
HALVINGS = 50


@functools.lru_cache(maxsize=256)
def damper_needs(damper: Damper) -> float:
    """Return the device damping without which a damper in a motor is not passive."""
    if damper.damping == 0.0:
        return 0.0
    return needed_damping(wall_transfer(_loop(damper)), damper.loop_s, damper.late).damping


def least_damping(damper: Damper, device: float, period: float) -> float:
    """Return the least D over all frequencies, which counts for any law of a `period` [s].

    `device` is its own viscous damping; both in [N m s/rad or N s/m]. Below 0 where the device has
    too little for the damper itself.
    """
    effective = _effective(damper, device, period)
    if effective is None:
        return device - damper_needs(damper)
    return float(effective.min()) * (1.0 - MARGIN)


@functools.lru_cache(maxsize=256)
def least_device(damper: Damper, device: float, period: float, wanted: float) -> float:
    """Return the least damping of a device, up to `device`, which the damper makes `wanted`.

    For any law of a `period` [s]; `device` where that is too little. The rest is the device's own
    for what else needs it, whatever the damper does.
    """
    low, high = damper_needs(damper), device
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if least_damping(damper, middle, period) < wanted:
            low = middle
        else:
            high = middle
    return high


def damping_for(damper: Damper, device: float, wall: SampledWall) -> float:
    """Return the damping that does for a wall what device and damper do, at most.

    A wall passes with that viscous damping exactly if it passes with D at every frequency: it is
    the least of D L* / L, L what the wall needs at each frequency, and L* the most of it.
    """
    effective = _effective(damper, device, wall.period)
    if effective is None or split_delay(wall.delay)[1] > 0.0:
        return device - damper_needs(damper)
    greatest = wall_leak(wall).damping
    if not 0.0 < greatest < math.inf:
        return float(effective.min()) * (1.0 - MARGIN)
    transfer = wall_transfer(wall)
    top, bottom = reduce_fraction(transfer.numerator, transfer.denominator)
    needed = 0.5 * wall.period * leak_form(top, bottom, wall.delay).values(THETA)
    wants = needed > 1e-6 * greatest
    return float((effective[wants] * greatest / needed[wants]).min()) * (1.0 - MARGIN)


@functools.lru_cache(maxsize=256)
def spent_on(damper: Damper, device: float, wall: SampledWall) -> float:
    """Return the least damping of a device, up to `device`, with which a wall passes.

    inf where it does not. What is left does not depend on the damper, whatever else uses it.
    """
    wanted = wall_leak(wall).damping
    if damping_for(damper, device, wall) < wanted:
        return math.inf
    low, high = damper_needs(damper), device
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if damping_for(damper, middle, wall) < wanted:
            low = middle
        else:
            high = middle
    return high


@functools.lru_cache(maxsize=512)
def _effective(damper: Damper, device: float, period: float) -> Floats | None:
    """Return D at the angles THETA; None where the device has too little for the damper."""
    if damper_needs(damper) >= device:
        return None
    count = max(1, math.floor(period / damper.loop_s + 1e-9))
    theta = THETA[:, None]
    phi = (theta + 2.0 * math.pi * np.arange(count)) / count
    left = device - _taken(damper, phi)
    if float(left.min()) <= 0.0:  # at the edge: rounding decides
        return None
    passed = (np.sin(0.5 * theta) / np.sin(0.5 * phi)) ** 2
    return np.asarray(count**2 / np.sum(passed / left, axis=1))


def _loop(damper: Damper) -> SampledWall:
    return SampledWall(0.0, damper.damping, damper.loop_s, damper.late, damper.filter_s)


def _taken(damper: Damper, phi: Floats) -> Floats:
    """Return L of the motor's loop at angles of its own rate, in (0, 2 pi); of the shape of phi.

    A share of a loop in its delay would take a little more; such a delay is rounded up.
    """
    loop = _loop(damper)
    gain = velocity_gain(loop)
    step = np.exp(1j * phi) - 1.0
    law = damper.damping * gain * step / (loop.period * (step + gain))
    law = law * np.exp(-1j * phi * math.ceil(damper.late - 1e-9))
    cotangent = np.cos(0.5 * phi) / np.sin(0.5 * phi)
    return np.asarray(0.5 * loop.period * (law.real - cotangent * law.imag))
