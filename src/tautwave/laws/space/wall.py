"""The force of a wall in space on the tip of a device, and what of it energy allows; SI units.

A sampled sphere, edge or box speeds a bouncing mass up by as much as a twelfth. What a wall gives
is therefore bounded by what it has taken: with E in its account, a force s F that is held for a
period T gives s F.v T + s^2 F.F T^2 / 2m to a tip of mass m that nothing else moves, so the
greatest share s that keeps E is the root of a quadratic. The account is then closed with the
displacement that came about.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.space.proxy import Surface, proxy_of


class SpaceWallParams(NamedTuple):
    """A surface with stiffness [N/m], damping [N s/m], friction coefficient, greatest force [N]."""

    surface: Surface
    stiffness: float
    damping: float
    friction: float
    limit: float


def wall_proxy(
    p: SpaceWallParams, px: float, py: float, pz: float, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return the proxy of a tip at x, y, z that was at px, py, pz, and the depth [m]; 0: free.

    With friction it stays behind on the surface, by no more than friction times depth.
    """
    cx, cy, cz = proxy_of(p.surface, px, py, pz, x, y, z)
    nx = cx - x
    ny = cy - y
    nz = cz - z
    depth = math.sqrt(nx * nx + ny * ny + nz * nz)
    if depth == 0.0 or p.friction == 0.0:
        return cx, cy, cz, depth
    nx = nx / depth
    ny = ny / depth
    nz = nz / depth
    tx = px - cx
    ty = py - cy
    tz = pz - cz
    off = tx * nx + ty * ny + tz * nz
    tx = tx - off * nx
    ty = ty - off * ny
    tz = tz - off * nz
    behind = math.sqrt(tx * tx + ty * ty + tz * tz)
    if behind == 0.0:
        return cx, cy, cz, depth
    share = min(p.friction * depth / behind, 1.0)
    wx = cx + share * tx
    wy = cy + share * ty
    wz = cz + share * tz
    qx, qy, qz = proxy_of(p.surface, cx, cy, cz, wx, wy, wz)
    if qx != wx or qy != wy or qz != wz:
        return cx, cy, cz, depth  # something is in the way
    return wx, wy, wz, depth


def wall_force(
    p: SpaceWallParams, dx: float, dy: float, dz: float, vx: float, vy: float, vz: float
) -> tuple[float, float, float]:
    """Return the force [N] on a tip that is away from its proxy by d [m] and moves at v [m/s]."""
    away = math.sqrt(dx * dx + dy * dy + dz * dz)
    if away == 0.0:
        return 0.0, 0.0, 0.0
    out = (vx * dx + vy * dy + vz * dz) / away
    push = p.stiffness * away - p.damping * out
    push = min(max(push, 0.0), p.limit)
    return push / away * dx, push / away * dy, push / away * dz


def allowed_share(account: float, given: float, accelerated: float) -> float:
    """Return the greatest share s of a force, at most 1, that the account pays for.

    s `given` + s^2 `accelerated` is the energy [J] that the force gives in a period: by the speed
    that there is, and by the speed that it adds.
    """
    if given + accelerated <= account:
        return 1.0
    if accelerated <= 0.0:
        return max(account / given, 0.0) if given > 0.0 else 1.0
    root = math.sqrt(given * given + 4.0 * accelerated * max(account, 0.0))
    # The root of the quadratic without a difference of nearly equal numbers.
    share = 2.0 * max(account, 0.0) / (given + root) if given > 0.0 else 0.0
    if given <= 0.0:
        share = (root - given) / (2.0 * accelerated)
    return min(max(share, 0.0), 1.0)
