"""The proxy of a point at a mesh: it goes towards the point until triangles block it; in m."""

from __future__ import annotations

import math
from typing import Any

SIZE = 16
"""Numbers of a triangle: a corner, two edges, normal, middle, reach from it."""

CLEAR = 1e-7
"""[m] How far a proxy stays off the triangles that block it."""

EDGE = 1e-9
"""Share of a triangle's edge by which its neighbours overlap: no gap between them."""


def mesh_proxy(
    n: Any, px: float, py: float, pz: float, x: float, y: float, z: float
) -> tuple[float, float, float]:
    """Return where the proxy comes to [m]; x, y, z where nothing is in its way.

    Every triangle that blocks adds a plane, and the proxy goes on to the nearest place above the
    planes; above three it stays.
    """
    ax = ay = az = ad = 0.0
    bx = by = bz = bd = 0.0
    count = 0
    gx = x
    gy = y
    gz = z
    for _ in range(6):
        share, k = first_hit(n, px, py, pz, gx, gy, gz)
        if k < 0:
            return gx, gy, gz
        nx = n[k + 9]
        ny = n[k + 10]
        nz = n[k + 11]
        d = nx * n[k] + ny * n[k + 1] + nz * n[k + 2]
        if nx * px + ny * py + nz * pz < d:
            nx = -nx
            ny = -ny
            nz = -nz
            d = -d
        d = d + CLEAR
        # Up to the triangle, less what keeps it clear; it may have been nearer than that.
        way = nx * (gx - px) + ny * (gy - py) + nz * (gz - pz)
        above = nx * px + ny * py + nz * pz - d
        share = min(max(above / -way, 0.0), share) if way < 0.0 else 0.0
        px = px + share * (gx - px)
        py = py + share * (gy - py)
        pz = pz + share * (gz - pz)
        below = d - (nx * px + ny * py + nz * pz)
        if below > 0.0:
            px = px + below * nx
            py = py + below * ny
            pz = pz + below * nz
        if count == 2:
            return px, py, pz
        if count == 0:
            ax, ay, az, ad = nx, ny, nz, d
        else:
            bx, by, bz, bd = nx, ny, nz, d
        count = count + 1
        depth = d - (nx * x + ny * y + nz * z)
        gx = x + depth * nx
        gy = y + depth * ny
        gz = z + depth * nz
        if count == 2 and ax * gx + ay * gy + az * gz < ad:
            # Above both: the nearest place on the line where they meet.
            c = ax * bx + ay * by + az * bz
            if 1.0 - c * c < 1e-12:
                return px, py, pz
            one = ad - (ax * x + ay * y + az * z)
            two = bd - (bx * x + by * y + bz * z)
            s = (one - c * two) / (1.0 - c * c)
            t = (two - c * one) / (1.0 - c * c)
            gx = x + s * ax + t * bx
            gy = y + s * ay + t * by
            gz = z + s * az + t * bz
    return px, py, pz


def first_hit(
    n: Any, px: float, py: float, pz: float, gx: float, gy: float, gz: float
) -> tuple[float, int]:
    """Return the share of the way from p to g [1] at which it meets a triangle, which; -1: none."""
    dx = gx - px
    dy = gy - py
    dz = gz - pz
    half = 0.5 * math.sqrt(dx * dx + dy * dy + dz * dz)
    mx = px + 0.5 * dx
    my = py + 0.5 * dy
    mz = pz + 0.5 * dz
    best = 1.0
    hit = -1
    for k in range(0, len(n), SIZE):
        far = half + n[k + 15] + CLEAR
        ex = n[k + 12] - mx
        ey = n[k + 13] - my
        ez = n[k + 14] - mz
        if ex * ex + ey * ey + ez * ez > far * far:
            continue
        way = n[k + 9] * dx + n[k + 10] * dy + n[k + 11] * dz
        rx = px - n[k]
        ry = py - n[k + 1]
        rz = pz - n[k + 2]
        above = n[k + 9] * rx + n[k + 10] * ry + n[k + 11] * rz
        if way == 0.0 or above * way > 0.0:
            continue  # beside it, or away from it
        share = -above / way
        if share > best or share < 0.0:
            continue
        rx = rx + share * dx
        ry = ry + share * dy
        rz = rz + share * dz
        uu = n[k + 3] * n[k + 3] + n[k + 4] * n[k + 4] + n[k + 5] * n[k + 5]
        vv = n[k + 6] * n[k + 6] + n[k + 7] * n[k + 7] + n[k + 8] * n[k + 8]
        uv = n[k + 3] * n[k + 6] + n[k + 4] * n[k + 7] + n[k + 5] * n[k + 8]
        ru = rx * n[k + 3] + ry * n[k + 4] + rz * n[k + 5]
        rv = rx * n[k + 6] + ry * n[k + 7] + rz * n[k + 8]
        area = uu * vv - uv * uv
        a = (ru * vv - rv * uv) / area
        b = (rv * uu - ru * uv) / area
        if a >= -EDGE and b >= -EDGE and a + b <= 1.0 + EDGE:
            best = share
            hit = k
    return best, hit
