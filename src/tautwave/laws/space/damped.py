"""A tip that follows velocities: least squares of the joints' speeds, bounded where it is singular.

With J the derivative of the coordinates that are led, scaled by lengths S, and J S' its singular
values s, the joints get q' = J^T G v, and the effort on the coordinates is F = G J tau, tau those
that act on the joints: with the same symmetric G both ways, tau.q' = F.v in any pose. G has
1 / s^2 where s is above a floor, and 1 / floor^2 below: only the lost directions lag, and no joint
is asked for more than v / floor. There the tip moves by J q', less than v, so that F.(J q') is not
tau.q': what is given out beyond is F.(J q' - v) a second, which an account has to cover.
(Maciejewski and Klein 1988: numerical filtering.)
"""

from __future__ import annotations

import math
from typing import Any

SWEEPS = 12
"""Of Jacobi's rotations at most; from the axes of a pose close by one or two do."""

SMALL = 1e-10
"""Off the diagonal, as a share of the trace, below which a matrix counts as diagonal."""


def diagonalise(matrix: Any, axes: Any, n: int) -> None:
    """Turn a symmetric matrix into its principal axes by Jacobi's rotations.

    Parameters
    ----------
    matrix : sequence of n * n floats
        Row by row; becomes diagonal.
    axes : sequence of n * n floats
        Axes in its columns, orthonormal; they are turned along.
    n : int
        Rows.
    """
    trace = 0.0
    for i in range(n):
        trace = trace + matrix[i * n + i]
    for _ in range(SWEEPS):
        off = 0.0
        for i in range(n):
            for j in range(i + 1, n):
                a = matrix[i * n + j]
                off = max(off, abs(a))
                if abs(a) <= SMALL * trace:
                    continue
                theta = 0.5 * (matrix[j * n + j] - matrix[i * n + i]) / a
                t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(n):
                    left, right = matrix[k * n + i], matrix[k * n + j]
                    matrix[k * n + i] = c * left - s * right
                    matrix[k * n + j] = s * left + c * right
                    left, right = axes[k * n + i], axes[k * n + j]
                    axes[k * n + i] = c * left - s * right
                    axes[k * n + j] = s * left + c * right
                for k in range(n):
                    left, right = matrix[i * n + k], matrix[j * n + k]
                    matrix[i * n + k] = c * left - s * right
                    matrix[j * n + k] = s * left + c * right
        if off <= SMALL * trace:
            return


def damped_inverse(
    jacobian: Any, axes: Any, scales: Any, floor: float
) -> tuple[list[float], float]:
    """Return G row by row, in the coordinates' own units, and the least singular value [m].

    Parameters
    ----------
    jacobian : sequence of m * n floats
        Of m coordinates, row by row.
    axes : sequence of m * m floats
        Those of a pose close by in columns, or any orthonormal ones; become those of this pose.
    scales : sequence of m floats
        Length that counts of a coordinate's unit: 1, of a turn [m/rad].
    floor : float
        Singular value [m] below which a direction counts as lost.
    """
    m = len(scales)
    n = len(jacobian) // m
    # J J^T in the axes given: nearly diagonal, if they are those of a pose close by.
    turned = [0.0] * (m * n)
    for i in range(m):
        for j in range(n):
            total = 0.0
            for k in range(m):
                total = total + axes[k * m + i] * scales[k] * jacobian[k * n + j]
            turned[i * n + j] = total
    matrix = [0.0] * (m * m)
    for i in range(m):
        for j in range(i, m):
            total = 0.0
            for k in range(n):
                total = total + turned[i * n + k] * turned[j * n + k]
            matrix[i * m + j] = total
            matrix[j * m + i] = total
    diagonalise(matrix, axes, m)
    least = min([matrix[i * m + i] for i in range(m)])
    gains = [1.0 / max(matrix[i * m + i], floor * floor) for i in range(m)]
    inverse = [0.0] * (m * m)
    for i in range(m):
        for j in range(i, m):
            total = 0.0
            for k in range(m):
                total = total + axes[i * m + k] * gains[k] * axes[j * m + k]
            total = total * scales[i] * scales[j]
            inverse[i * m + j] = total
            inverse[j * m + i] = total
    return inverse, math.sqrt(max(least, 0.0))


def room_for(given: float, gift: float, reserve: float) -> float:
    """Return which share of a motion an account allows, 0 to 1.

    Parameters
    ----------
    given : float
        What was given out so far [J].
    gift : float
        What the motion would give out beyond [J].
    reserve : float
        The most that may be given out [J].
    """
    if gift <= 0.0 or given + gift <= reserve:
        return 1.0
    share = (reserve - given) / gift
    return share if share > 0.0 else 0.0  # NaN moves nothing
