"""The device damping that a wall needs whose damper takes the device's own velocity.

A device samples its position every t, filters the differences, w, and reports w beside its
position every T = N t. The wall's effort u = K x + B w is held for T. Let D_n be the motion dx of
the device per t at the N angles phi_n = (theta + 2 pi n) / N that fall on theta, and

    S_n = (e^(j theta) - 1) / (e^(j phi_n) - 1),
    G_n = e^(-j theta d) [K / (e^(j phi_n) - 1) + B W_n]

what they make of the motion dX per T and of u, W the transfer of w, d the delay in periods. In
motion of viscous damping b the device takes at least (b / t) sum |dx|^2, so it is passive with any
hand exactly if, for all theta,

    (b N / t) |D|^2 + Re [conj(G D) (S D)] >= 0  for all D,

a form of rank two. With <S, G> = R + j I and |S|^2 = N^2 the least b is

    b(theta) = t / (2 N) [sqrt(R^2 + N^2 |G'|^2) - R],

G' the part of G that is orthogonal to S. A law of positions alone has none, since x follows from
the motion dX: then this is Colgate and Schenkel's condition. A measured velocity has it, for a hand
may move the device between two samples so that w says anything about the way of the whole period.

Source: derived here, after Colgate & Schenkel, J. Robotic Systems 14(1), 1997.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.walls.in_motor import THETA
from tautwave.models.linear import flow_rows

Floats = npt.NDArray[np.float64]


class Velocimeter(NamedTuple):
    """A device's own velocity: sampled every `loop_s` [s], filtered, `late` loops old."""

    filter_s: float
    loop_s: float = 5e-5
    late: int = 1


def needed_at(
    meter: Velocimeter, stiffness: float, damping: float, period: float, delay: int
) -> Floats:
    """Return b at the angles THETA [N m s/rad or N s/m]; K and B in the same units."""
    count = round(period / meter.loop_s)
    theta = THETA[:, None]
    phi = (theta + 2.0 * math.pi * np.arange(count)) / count
    step = np.exp(1j * phi) - 1.0
    passed = (np.exp(1j * theta) - 1.0) / step
    gain = meter.loop_s / (meter.loop_s + meter.filter_s)
    speed = gain / (meter.loop_s * (step + gain)) * np.exp(-1j * phi * meter.late)
    late = np.exp(-1j * theta * delay)
    spring, damper = late * stiffness / step, late * damping * speed
    along = np.sum(passed.conj() * (spring + damper), axis=1).real
    share = np.sum(passed.conj() * damper, axis=1) / count**2
    across = np.sum(np.abs(damper - share[:, None] * passed) ** 2, axis=1)
    root = np.sqrt(along**2 + count**2 * across)
    return np.asarray(0.5 * meter.loop_s / count * (root - along))


def greatest_damping(meter: Velocimeter, device: float, period: float, delay: int) -> float:
    """Return the greatest B that is passive on a device of viscous damping, without a spring."""
    return device / float(needed_at(meter, 0.0, 1.0, period, delay).max())


# -- one mass on a spring and a damper, exactly ---------------------------------------------------

X, V, LAST, SPEED, HOST, NEXT, BEFORE, SMOOTH, SIZE = range(9)
"""States: x, v, the motor's last sample, its filtered velocity, the host's effort that acts, the
one that acts next, the host's last sample, and its velocity from differences."""


def radius(
    meter: Velocimeter | None,
    wall: tuple[float, float],
    period: float,
    delay: int,
    user: tuple[float, float, float],
    filter_s: float = 0.0,
    loop_s: float = 5e-5,
) -> float:
    """Return the spectral radius of a period of a wall (K, B) on a mass, damper and spring.

    `delay` is 0 or 1. Without a meter the host takes differences of positions behind `filter_s`.
    """
    mass, damping, stiffness = user
    xv, xn, _, vv, vn, _, _, _, _ = flow_rows(stiffness, damping, mass, loop_s)
    net = np.zeros(SIZE)
    net[X], net[V], net[HOST] = -stiffness, -damping, -1.0
    moved = np.eye(SIZE)
    moved[X] += xn * net
    moved[X, V] += xv
    moved[V] += vn * net
    moved[V, V] += vv
    unit = np.eye(SIZE)
    sampled, late = np.eye(SIZE), 0
    if meter is not None:
        gain, late = meter.loop_s / (meter.loop_s + meter.filter_s), meter.late
        sampled[SPEED] = (1.0 - gain) * unit[SPEED] + gain / loop_s * (unit[X] - unit[LAST])
        sampled[LAST] = unit[X]
    # Late by a loop: the velocity of a sample is reported beside the next one.
    assert late in (0, 1)
    loop = moved @ sampled if late else sampled @ moved
    host = np.eye(SIZE)
    g = period / (period + filter_s)
    host[SMOOTH] = (1.0 - g) * unit[SMOOTH] + g / period * (unit[X] - unit[BEFORE])
    host[BEFORE] = unit[X]
    host[NEXT] = wall[0] * unit[X] + wall[1] * (unit[SPEED] if meter else host[SMOOTH])
    host[HOST] = unit[NEXT] if delay else host[NEXT]
    whole = np.linalg.matrix_power(loop, round(period / loop_s)) @ host
    return float(np.abs(np.linalg.eigvals(whole)).max())
