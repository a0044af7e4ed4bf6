"""Three by three matrices as tuples of floats, for plain Python and for numba.

A matrix is (9,) row by row; a symmetric one is (6,): xx, yy, zz, yz, xz, xy.
"""

from __future__ import annotations

import math

Matrix = tuple[float, float, float, float, float, float, float, float, float]
Symmetric = tuple[float, float, float, float, float, float]
Vector = tuple[float, float, float]

_TURNED = 1e-9
"""[rad] A correction of a rotation after which the next one is below rounding."""


def product(a: Matrix, b: Matrix) -> Matrix:
    """Return a b."""
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


def transposed(a: Matrix) -> Matrix:
    """Return the transpose of a."""
    return (a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8])


def halfway(a: Matrix, b: Matrix) -> Matrix:
    """Return (a + b)/2."""
    return (
        0.5 * (a[0] + b[0]),
        0.5 * (a[1] + b[1]),
        0.5 * (a[2] + b[2]),
        0.5 * (a[3] + b[3]),
        0.5 * (a[4] + b[4]),
        0.5 * (a[5] + b[5]),
        0.5 * (a[6] + b[6]),
        0.5 * (a[7] + b[7]),
        0.5 * (a[8] + b[8]),
    )


def full(a: Symmetric) -> Matrix:
    """Return a symmetric matrix as one of nine entries."""
    return (a[0], a[5], a[4], a[5], a[1], a[3], a[4], a[3], a[2])


def applied(a: Symmetric, v: Vector) -> Vector:
    """Return a v."""
    return (
        a[0] * v[0] + a[5] * v[1] + a[4] * v[2],
        a[5] * v[0] + a[1] * v[1] + a[3] * v[2],
        a[4] * v[0] + a[3] * v[1] + a[2] * v[2],
    )


def inner(a: Symmetric, b: Symmetric) -> float:
    """Return a : b, the trace of their product."""
    along = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    across = a[3] * b[3] + a[4] * b[4] + a[5] * b[5]
    return along + 2.0 * across


def inverse(a: Symmetric) -> tuple[Symmetric, float]:
    """Return the inverse of a and its determinant; zeros if that is 0."""
    xx = a[1] * a[2] - a[3] * a[3]
    xy = a[4] * a[3] - a[5] * a[2]
    xz = a[5] * a[3] - a[4] * a[1]
    size = a[0] * xx + a[5] * xy + a[4] * xz
    if size == 0.0:
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 0.0
    one = 1.0 / size
    return (
        one * xx,
        one * (a[0] * a[2] - a[4] * a[4]),
        one * (a[0] * a[1] - a[5] * a[5]),
        one * (a[4] * a[5] - a[0] * a[3]),
        one * xz,
        one * xy,
    ), size


def turning(u: Symmetric) -> Symmetric:
    """Return tr(u) I - u: how a stretch u resists to be turned by its rotation."""
    return (u[1] + u[2], u[0] + u[2], u[0] + u[1], -u[3], -u[4], -u[5])


def rotation_of(f: Matrix, start: Matrix) -> Matrix:
    """Return the rotation r at which r : f is greatest: the polar one, also where f is inverted.

    Newton's iterations on the group of rotations: r w turns r such that r^T f becomes symmetric,
    (tr(u) I - u) w = axial(r^T f - f^T r). Where that matrix is not positive definite, or the last
    step made r : f smaller, it is made stiff enough that no step overshoots. A `start` with a few
    correct digits makes it two or three iterations.

    Parameters
    ----------
    f : Matrix
        Deformation gradient.
    start : Matrix
        A rotation near the result.
    """
    r = start
    before = -math.inf
    for _ in range(400):
        m = product(transposed(r), f)
        bx, by, bz = m[7] - m[5], m[2] - m[6], m[3] - m[1]
        u = (m[0], m[4], m[8], 0.5 * (m[5] + m[7]), 0.5 * (m[2] + m[6]), 0.5 * (m[1] + m[3]))
        g = turning(u)
        back, size = inverse(g)
        minor = g[0] * g[1] - g[5] * g[5]
        grown = u[0] + u[1] + u[2]
        least = before - 1e-9 * math.fabs(before)
        if not (g[0] > 0.0 and minor > 0.0 and size > 0.0 and grown >= least):
            lift = 1.5 * math.sqrt(inner(u, u)) + 1e-300
            back, _ = inverse((g[0] + lift, g[1] + lift, g[2] + lift, g[3], g[4], g[5]))
        w = applied(back, (bx, by, bz))
        before = grown
        r = product(r, cayley(w))
        if not w[0] * w[0] + w[1] * w[1] + w[2] * w[2] > _TURNED * _TURNED:
            break
    return r


def cayley(w: Vector) -> Matrix:
    """Return the rotation of the quaternion (1, w/2): about w, by nearly |w| [rad]."""
    x, y, z = 0.5 * w[0], 0.5 * w[1], 0.5 * w[2]
    k = 2.0 / (1.0 + x * x + y * y + z * z)
    return (
        1.0 - k * (y * y + z * z),
        k * (x * y - z),
        k * (x * z + y),
        k * (x * y + z),
        1.0 - k * (x * x + z * z),
        k * (y * z - x),
        k * (x * z - y),
        k * (y * z + x),
        1.0 - k * (x * x + y * y),
    )


def squared_up(r: Matrix) -> Matrix:
    """Return a rotation of which rounding has taken the right angles, with them again."""
    m = product(transposed(r), r)
    return product(
        r,
        (
            1.5 - 0.5 * m[0],
            -0.5 * m[1],
            -0.5 * m[2],
            -0.5 * m[3],
            1.5 - 0.5 * m[4],
            -0.5 * m[5],
            -0.5 * m[6],
            -0.5 * m[7],
            1.5 - 0.5 * m[8],
        ),
    )


def stretch_of(r: Matrix, f: Matrix) -> Symmetric:
    """Return the symmetric part of r^T f."""
    m = product(transposed(r), f)
    return (m[0], m[4], m[8], 0.5 * (m[5] + m[7]), 0.5 * (m[2] + m[6]), 0.5 * (m[1] + m[3]))
