"""Where a point that pushes into a surface would be if it could not: its proxy; lengths in m.

The proxy stays where the body is not and goes as near to the point as it can get from where it was
(Zilles and Salisbury, "A constraint-based god-object method", IROS 1995). So a plate thinner than
a step is not passed, and of two faces the one that was crossed pushes. Surfaces are plain numbers.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tautwave.laws.space.triangles import mesh_proxy

PLANES, ROUND, MESH, PATH = 0, 1, 2, 3
TOUCH = 1e-9
"""[m] By how much a proxy may be below a face that it lies on: rounding."""

Vector = Any  # three floats


class Surface(NamedTuple):
    """A surface: its kind, and numbers that its kind gives a meaning [m or 1]."""

    kind: int
    numbers: tuple[float, ...]


def plane(point: Vector, normal: Vector) -> Surface:
    """Return all that is below a plane through `point` [m]; `normal` points out of it."""
    nx, ny, nz = normal
    d = nx * point[0] + ny * point[1] + nz * point[2]
    return convex([(nx, ny, nz, d)])


def convex(faces: Any) -> Surface:
    """Return a convex body: of each face the normal, out of it, and its distance from 0 [m]."""
    numbers: list[float] = []
    for nx, ny, nz, d in faces:
        size = math.sqrt(nx * nx + ny * ny + nz * nz)
        numbers += [nx / size, ny / size, nz / size, d / size]
    return Surface(PLANES, tuple(numbers))


def sphere(centre: Vector, radius: float, *, hollow: bool = False) -> Surface:
    """Return a ball, or all that is outside of one [m]."""
    return Surface(ROUND, (*centre, 0.0, 0.0, 0.0, radius, 0.0, -1.0 if hollow else 1.0))


def cylinder(
    centre: Vector, axis: Vector, radius: float, length: float = 0.0, *, hollow: bool = False
) -> Surface:
    """Return a cylinder around its middle, endless where `length` is 0; or all outside [m]."""
    size = math.sqrt(sum(part * part for part in axis))
    unit = [part / size for part in axis]
    sign = -1.0 if hollow else 1.0
    return Surface(ROUND, (*centre, *unit, radius, 0.5 * length, sign))


def mesh(points: Any, triangles: Any) -> Surface:
    """Return triangles that block from both sides; those without area are left out [m]."""
    numbers: list[float] = []
    for i, j, k in triangles:
        a, b, c = points[i], points[j], points[k]
        u = [b[n] - a[n] for n in range(3)]
        v = [c[n] - a[n] for n in range(3)]
        w = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        size = math.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
        if size == 0.0:
            continue
        middle = [(a[n] + b[n] + c[n]) / 3.0 for n in range(3)]
        reach = max(math.dist(corner, middle) for corner in (a, b, c))
        numbers += [*a, *u, *v, w[0] / size, w[1] / size, w[2] / size, *middle, reach]
    return Surface(MESH, tuple(numbers))


def path(points: Any, radius: float) -> Surface:
    """Return a line through stations that leads a point within `radius` of it [m]."""
    return Surface(PATH, (radius, *(part for point in points for part in point)))


def proxy_of(
    s: Surface, px: float, py: float, pz: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return the proxy of a point at x, y, z, whose proxy was at px, py, pz; itself if it is free.

    All in m; friction is not in it.
    """
    n = s.numbers
    if s.kind == PLANES:
        return _convex_proxy(n, px, py, pz, x, y, z)
    if s.kind == ROUND:
        return _round_proxy(n, px, py, pz, x, y, z)
    if s.kind == MESH:
        return mesh_proxy(n, px, py, pz, x, y, z)
    return _path_proxy(n, x, y, z)


def _convex_proxy(
    n: Any, px: float, py: float, pz: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Go to the nearest point above one of the faces that the proxy is above.

    All above one face is free of the body, so that the way is; then from there on, for edges.
    """
    for _ in range(4):
        best = -1
        least = math.inf
        nearest = -1
        shallow = math.inf
        for k in range(0, len(n), 4):
            depth = n[k + 3] - (n[k] * x + n[k + 1] * y + n[k + 2] * z)
            if depth <= 0.0:
                depth = 0.0
            if depth < shallow:
                shallow = depth
                nearest = k
            above = n[k] * px + n[k + 1] * py + n[k + 2] * pz - n[k + 3]
            if above >= -TOUCH and depth < least:
                least = depth
                best = k
        if best < 0:
            best = nearest  # it began inside: out by the nearest face
            least = shallow
        if least == 0.0:
            return x, y, z
        qx = x + least * n[best]
        qy = y + least * n[best + 1]
        qz = z + least * n[best + 2]
        if qx == px and qy == py and qz == pz:
            break
        px = qx
        py = qy
        pz = qz
    return px, py, pz


def _round_proxy(
    n: Any, px: float, py: float, pz: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Spheres and cylinders; of a cylinder's side and ends the one that the proxy was beyond."""
    cx = n[0]
    cy = n[1]
    cz = n[2]
    ax = n[3]
    ay = n[4]
    az = n[5]
    radius = n[6]
    half = n[7]
    sign = n[8]
    dx = x - cx
    dy = y - cy
    dz = z - cz
    along = dx * ax + dy * ay + dz * az
    dx = dx - along * ax
    dy = dy - along * ay
    dz = dz - along * az
    out = math.sqrt(dx * dx + dy * dy + dz * dz)
    if sign * (out - radius) >= 0.0 or (half > 0.0 and abs(along) >= half):
        return x, y, z
    if half > 0.0:
        ex = px - cx
        ey = py - cy
        ez = pz - cz
        was = ex * ax + ey * ay + ez * az
        ex = ex - was * ax
        ey = ey - was * ay
        ez = ez - was * az
        beside = math.sqrt(ex * ex + ey * ey + ez * ez) >= radius - TOUCH
        beyond = abs(was) >= half - TOUCH
        top = was if beyond else along
        cap = half - math.copysign(1.0, top) * along
        if (beyond and not beside) or (beyond == beside and cap < radius - out):
            move = math.copysign(cap, top)
            return x + move * ax, y + move * ay, z + move * az
    if out == 0.0:
        # On the axis no way out is nearer: along any.
        dx, dy, dz = (0.0, -az, ay) if abs(ax) < 0.5 else (-az, 0.0, ax)
        if ax == 0.0 and ay == 0.0 and az == 0.0:
            dx, dy, dz = 1.0, 0.0, 0.0
        out = math.sqrt(dx * dx + dy * dy + dz * dz)
        return x + radius / out * dx, y + radius / out * dy, z + radius / out * dz
    push = (radius - out) / out
    return x + push * dx, y + push * dy, z + push * dz


def _path_proxy(n: Any, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return the nearest point within the path's radius."""
    radius = n[0]
    least = math.inf
    bx = n[1]
    by = n[2]
    bz = n[3]
    for k in range(1, len(n) - 3, 3):
        ux = n[k + 3] - n[k]
        uy = n[k + 4] - n[k + 1]
        uz = n[k + 5] - n[k + 2]
        size = ux * ux + uy * uy + uz * uz
        t = 0.0
        if size > 0.0:
            t = ((x - n[k]) * ux + (y - n[k + 1]) * uy + (z - n[k + 2]) * uz) / size
            t = min(max(t, 0.0), 1.0)
        qx = n[k] + t * ux
        qy = n[k + 1] + t * uy
        qz = n[k + 2] + t * uz
        away = (x - qx) * (x - qx) + (y - qy) * (y - qy) + (z - qz) * (z - qz)
        if away < least:
            least = away
            bx = qx
            by = qy
            bz = qz
    away = math.sqrt((x - bx) * (x - bx) + (y - by) * (y - by) + (z - bz) * (z - bz))
    if away <= radius:
        return x, y, z
    share = radius / away
    return bx + share * (x - bx), by + share * (y - by), bz + share * (z - bz)
