"""A 3D link in a discrete-gradient step: mean tension, derivative, books.

With D the way from b to a before the step and D' after it, r and r' their lengths, a link pulls
along (D + D')/(r + r') with its mean tension over r' - r: its work is then exactly the change of
its potential, whatever the step, and it exerts no torque. At r = r' = 0 there is no force. Dampers
and friction take the rate (r' - r)/T.

The stretch of a contact with a solid is the distance f from its surface. With n its gradient before
the step of movement s it pulls along n + (f' - f - n . s) s/|s|^2: again its work is the change of
its potential to rounding, over edges, corners, and where the nearest face changes deep inside.
There f has no gradient, but it is as continuous as anywhere, and so is the pull, with n of before.

Sources: LaBudde & Greenspan 1976; Gonzalez 1996.
"""

from __future__ import annotations

import math

from tautwave_scenes.models.interaction import (
    CONTACT,
    FRICTION,
    NEGATIVE,
    PLASTIC,
    elastic_energy,
    lossy_contact,
    mean_tension,
    rate_tension,
    yielded,
)
from tautwave_scenes.models.surface import beside_box, surface_of
from tautwave_scenes.networks3d.arrays import Arrays3d


def surface_at(
    s: Arrays3d, i: int, x: float, y: float, z: float
) -> tuple[float, float, float, float]:
    """Return the distance of a place from the surface of a link's solid [m], and its gradient."""
    root = 3 * (s.flat[i] - 2)
    first = s.roots[root]
    end = s.roots[root + 1]
    far, nx, ny, nz, triangle = surface_of(s.tree, s.boxes, s.faces, first, end, s.near[i], x, y, z)
    s.near[i] = triangle
    return far, nx, ny, nz


def is_beside(s: Arrays3d, i: int, x: float, y: float, z: float) -> bool:
    """Return whether a place is outside the box around a link's solid."""
    return bool(beside_box(s.boxes, s.roots[3 * (s.flat[i] - 2)], x, y, z) > 0.0)


_STILL = 1e-24
"""[m^2] Of a movement: below it the surface is a plane."""


def length_of(s: Arrays3d, i: int) -> float:
    """Return the distance of a link's ends, along its normal if it has one, or from its solid."""
    one = 3 * s.a[i]
    if s.flat[i] > 1:
        far, _, _, _ = surface_at(s, i, s.x[one], s.x[one + 1], s.x[one + 2])
        return far
    two = 3 * s.b[i]
    dx = s.x[one] - s.x[two]
    dy = s.x[one + 1] - s.x[two + 1]
    dz = s.x[one + 2] - s.x[two + 2]
    if s.flat[i]:
        at = 3 * i
        return float(s.normal[at] * dx + s.normal[at + 1] * dy + s.normal[at + 2] * dz)
    return math.sqrt(dx * dx + dy * dy + dz * dz)


def link_way(s: Arrays3d, i: int) -> list[float]:
    """Return the direction from b to a of a link, (0, 0, 0) if its ends coincide."""
    if s.flat[i] > 1:
        one = 3 * s.a[i]
        _, nx, ny, nz = surface_at(s, i, s.x[one], s.x[one + 1], s.x[one + 2])
        return [nx, ny, nz]
    if s.flat[i]:
        return [float(s.normal[3 * i + c]) for c in range(3)]
    r = length_of(s, i)
    gaps = [s.x[3 * s.a[i] + c] - s.x[3 * s.b[i] + c] for c in range(3)]
    return [gap / r if r > 0.0 else 0.0 for gap in gaps]


def jump_links(s: Arrays3d, port: int) -> None:
    """Book the change of energy stored in the links of a port that was moved."""
    node = s.count[0] + port
    for j in range(s.links_first[node], s.links_first[node + 1]):
        i = s.links_of[j]
        kind = s.kind[i]
        if kind >= FRICTION or s.k[i] == 0.0:
            continue
        if s.flat[i] > 1 and s.stored[i] == 0.0:
            one = 3 * s.a[i]
            if is_beside(s, i, s.x[one], s.x[one + 1], s.x[one + 2]):
                continue
        d = length_of(s, i) - s.rest[i] - s.set_in[i]
        if kind == CONTACT and d >= 0.0 and s.stored[i] == 0.0:
            continue
        stored = elastic_energy(kind, s.k[i], s.e[i], d)
        s.port_work[port] += stored - s.stored[i]
        s.stored[i] = stored


def port_rate(s: Arrays3d, i: int) -> float:
    """Return the rate at which ports stretch a link, along `way` [m/s]."""
    masses = s.count[0]
    at = 3 * i
    rate = 0.0
    if s.a[i] >= masses:
        for c in range(3):
            rate = rate + s.way[at + c] * s.v[3 * s.a[i] + c]
    if s.b[i] >= masses:
        for c in range(3):
            rate = rate - s.way[at + c] * s.v[3 * s.b[i] + c]
    return rate


def pull_link(s: Arrays3d, i: int, row: int, period: float) -> None:
    """Set mean tension, direction and derivative of a link whose masses move by a row of `work`.

    The pull on a is -tension way; its derivative by a's movement is -(way bend' + side I).
    `apart` becomes (movement along the link, 0, 0) for the books.
    """
    masses = s.count[0]
    at = 3 * i
    one = 3 * s.a[i]
    two = 3 * s.b[i]
    sx = sy = sz = 0.0
    if s.a[i] < masses:
        sx = s.work[row + one]
        sy = s.work[row + one + 1]
        sz = s.work[row + one + 2]
    if s.b[i] < masses:
        sx = sx - s.work[row + two]
        sy = sy - s.work[row + two + 1]
        sz = sz - s.work[row + two + 2]
    ex = ey = ez = 0.0  # direction at the end, for the derivative
    both = 0.0
    moved = 0.0
    if s.flat[i] > 1:
        dx = s.x[one]
        dy = s.x[one + 1]
        dz = s.x[one + 2]
        gx = dx + sx
        gy = dy + sy
        gz = dz + sz
        if is_beside(s, i, dx, dy, dz) and is_beside(s, i, gx, gy, gz):
            s.tension[i] = s.elastic[i] = s.side[i] = s.apart[at] = 0.0
            s.bend[at] = s.bend[at + 1] = s.bend[at + 2] = 0.0
            s.way[at] = s.way[at + 1] = s.way[at + 2] = 0.0
            return
        d, ex, ey, ez = surface_at(s, i, dx, dy, dz)
        s.way[at] = ex
        s.way[at + 1] = ey
        s.way[at + 2] = ez
        square = sx * sx + sy * sy + sz * sz
        if square > _STILL:
            far, fx, fy, fz = surface_at(s, i, gx, gy, gz)
            moved = far - d
            lack = (moved - (ex * sx + ey * sy + ez * sz)) / square
            s.way[at] = ex + lack * sx
            s.way[at + 1] = ey + lack * sy
            s.way[at + 2] = ez + lack * sz
            ex = fx
            ey = fy
            ez = fz
        else:
            moved = ex * sx + ey * sy + ez * sz
        d = d - s.rest[i]
    elif s.flat[i]:
        ex = s.normal[at]
        ey = s.normal[at + 1]
        ez = s.normal[at + 2]
        s.way[at] = ex
        s.way[at + 1] = ey
        s.way[at + 2] = ez
        d = length_of(s, i) - s.rest[i]
    else:
        dx = s.x[one] - s.x[two]
        dy = s.x[one + 1] - s.x[two + 1]
        dz = s.x[one + 2] - s.x[two + 2]
        r = math.sqrt(dx * dx + dy * dy + dz * dz)
        gx = dx + sx
        gy = dy + sy
        gz = dz + sz
        end = math.sqrt(gx * gx + gy * gy + gz * gz)
        both = r + end
        s.way[at] = s.way[at + 1] = s.way[at + 2] = 0.0
        if both > 0.0:
            s.way[at] = (dx + gx) / both
            s.way[at + 1] = (dy + gy) / both
            s.way[at + 2] = (dz + gz) / both
        if end > 0.0:
            ex = gx / end
            ey = gy / end
            ez = gz / end
        d = r - s.rest[i]
    if s.flat[i] < 2:
        moved = s.way[at] * sx + s.way[at + 1] * sy + s.way[at + 2] * sz
    s.apart[at] = moved
    kind = s.kind[i]
    if kind == CONTACT and d >= 0.0 and d + moved >= 0.0 and s.z[i] == 0.0:
        s.tension[i] = s.elastic[i] = s.side[i] = 0.0
        s.bend[at] = s.bend[at + 1] = s.bend[at + 2] = 0.0
        return
    given = port_rate(s, i)
    w = moved / period + given
    elastic = 0.0
    steep = 0.0  # derivative with respect to the rate alone
    if kind >= FRICTION:
        pull, steep = rate_tension(kind, s.z[i], s.limit[i], s.scale[i], w)
        slope = steep / period
    else:
        pull = 0.0
        slope = 0.0
        if s.k[i] > 0.0:
            elastic, slope = mean_tension(kind, s.k[i], s.e[i], d - s.set_in[i], moved)
            pull = elastic
            if s.loss[i] > 0.0:
                pull, slope = lossy_contact(elastic, slope, s.loss[i], w, 1.0 / period)
                if pull != 0.0:
                    steep = -elastic * s.loss[i]
        pull = pull + s.z[i] * w
        slope = slope + s.z[i] / period
        steep = steep + s.z[i]
    s.tension[i] = pull
    s.elastic[i] = elastic
    side = 0.0
    if both > 0.0:
        side = pull / both
    turn = slope - side
    if both > 0.0 and given != 0.0:
        turn = turn - steep * given / both
        share = steep / both
        s.bend[at] = turn * ex + share * _given(s, i, 0)
        s.bend[at + 1] = turn * ey + share * _given(s, i, 1)
        s.bend[at + 2] = turn * ez + share * _given(s, i, 2)
    else:
        s.bend[at] = turn * ex
        s.bend[at + 1] = turn * ey
        s.bend[at + 2] = turn * ez
    s.side[i] = side


def _given(s: Arrays3d, i: int, c: int) -> float:
    """Return a component of the speed at which ports move the ends of a link apart."""
    rate = 0.0
    if s.a[i] >= s.count[0]:
        rate = rate + s.v[3 * s.a[i] + c]
    if s.b[i] >= s.count[0]:
        rate = rate - s.v[3 * s.b[i] + c]
    return rate


def book_link3d(s: Arrays3d, i: int, period: float, share: float) -> None:
    """Book a link after its masses have moved; `share` is the part of the step that this was."""
    at = 3 * i
    one = s.a[i]
    two = s.b[i]
    masses = s.count[0]
    kind = s.kind[i]
    moved = s.apart[at]
    pull = s.tension[i]
    for c in range(3):
        part = share * pull * s.way[at + c]
        s.force[3 * one + c] -= part
        s.force[3 * two + c] += part
    swept = moved + period * port_rate(s, i)
    rate = pull
    if kind >= FRICTION:
        if kind < NEGATIVE:
            s.lost[i] += pull * swept
        else:
            s.made[i] -= pull * swept
    else:
        if s.k[i] > 0.0:
            d = length_of(s, i) - s.rest[i]
            stored = elastic_energy(kind, s.k[i], s.e[i], d - s.set_in[i])
            rate = pull - s.elastic[i]
            if kind == PLASTIC:
                s.set_in[i] = yielded(s.k[i], s.limit[i], d, s.set_in[i])
                less = elastic_energy(kind, s.k[i], 1.0, d - s.set_in[i])
                s.lost[i] += stored - less
                stored = less
            s.stored[i] = stored
        s.lost[i] += rate * swept
    for c in range(3):
        given = rate * period * s.way[at + c]
        if masses <= one < masses + s.count[1]:
            s.port_work[one - masses] += given * s.v[3 * one + c]
        if masses <= two < masses + s.count[1]:
            s.port_work[two - masses] -= given * s.v[3 * two + c]
