"""A host's wall beside a damper in the motor, exactly: two loops of different period on one mass.

The device with its hand is one mass on a spring and a damper. The motor's loop samples its position
every `loop_s`, filters the velocity, and holds its effort; the host's samples every N of these.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tautwave.models.linear import flow_rows
from tautwave.types import Damper

Matrix = npt.NDArray[np.float64]

# States: x, v, the motor's last sample, its filtered velocity, its effort under way, the host's
# effort that acts, and the one that acts next.
X, V, LAST, SPEED, UNDER_WAY, HOST, NEXT, SIZE = range(8)


def motor_step(damper: Damper, mass: float, damping: float, stiffness: float) -> Matrix:
    """Return the map of one loop of the motor, late by one; shape (7, 7)."""
    t = damper.loop_s
    gain = t / (t + damper.filter_s)
    sampled = np.eye(SIZE)
    sampled[SPEED] = 0.0
    sampled[SPEED, SPEED] = 1.0 - gain
    sampled[SPEED, X], sampled[SPEED, LAST] = gain / t, -gain / t
    sampled[LAST] = np.eye(SIZE)[X]
    assert damper.late in (0.0, 1.0)
    asked = np.eye(SIZE)
    asked[UNDER_WAY] = damper.damping * np.eye(SIZE)[SPEED]
    xv, xn, _, vv, vn, _, _, _, _ = flow_rows(stiffness, damping, mass, t)
    moved = np.eye(SIZE)
    net = np.zeros(SIZE)
    net[X], net[V], net[UNDER_WAY], net[HOST] = -stiffness, -damping, -1.0, -1.0
    moved[X] += xn * net
    moved[X, V] += xv
    moved[V] += vn * net
    moved[V, V] += vv
    # Late by one loop: what was asked at the sample before acts while this one is computed.
    return asked @ moved @ sampled if damper.late else moved @ asked @ sampled


def radius(
    damper: Damper,
    wall: float,
    period: float,
    mass: float,
    damping: float,
    stiffness: float,
    delay: int = 1,
) -> float:
    """Return the spectral radius of a period of the host, its wall late by `delay` periods."""
    count = round(period / damper.loop_s)
    motor = np.linalg.matrix_power(motor_step(damper, mass, damping, stiffness), count)
    host = np.eye(SIZE)
    host[NEXT] = wall * np.eye(SIZE)[X]
    host[HOST] = np.eye(SIZE)[NEXT] if delay else host[NEXT]
    return float(np.abs(np.linalg.eigvals(motor @ host)).max())
