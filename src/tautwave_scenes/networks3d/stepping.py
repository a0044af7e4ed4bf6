"""The standard mass-interaction step in 3D: symplectic Euler, with its energy books.

The counterpart of `networks.schemes.stepping`. A link's force is held over a step as a
vector, so its work is tension times its direction times the ends' movement; the energy that holding
and turning it creates or takes is `numeric`. Central forces and the order of this scheme keep
momentum and angular momentum. Coincident ends have no direction and no force.
"""

from __future__ import annotations

import math

from tautwave_scenes.models.interaction import (
    CONTACT,
    FRICTION,
    NEGATIVE,
    PLASTIC,
    SOURCE,
    elastic_energy,
    elastic_tension,
    rate_tension,
    yielded,
)
from tautwave_scenes.networks3d.arrays import Arrays3d
from tautwave_scenes.networks3d.tension import is_beside, surface_at


def set_forces3d(s: Arrays3d) -> None:
    """Book the work of every link since the last call, and set the forces at the present state."""
    x, v, force, way, apart = s.x, s.v, s.force, s.way, s.apart
    for at in range(3 * (s.count[0] + s.count[1])):
        force[at] = 0.0
    for i in range(s.count[2]):
        one = 3 * s.a[i]
        two = 3 * s.b[i]
        at = 3 * i
        dx = x[one] - x[two]
        dy = x[one + 1] - x[two + 1]
        dz = x[one + 2] - x[two + 2]
        kind = s.kind[i]
        if s.flat[i] > 1:
            shut = s.elastic[i] != 0.0 or s.z[i] != 0.0
            if not shut and is_beside(s, i, x[one], x[one + 1], x[one + 2]):
                continue
            far, nx, ny, nz = surface_at(s, i, x[one], x[one + 1], x[one + 2])
            d = far - s.rest[i]
            if d >= 0.0 and not shut:
                continue
        elif s.flat[i]:
            nx = s.normal[at]
            ny = s.normal[at + 1]
            nz = s.normal[at + 2]
            d = nx * dx + ny * dy + nz * dz - s.rest[i]
            if kind == CONTACT and d >= 0.0 and s.elastic[i] == 0.0 and s.z[i] == 0.0:
                continue
        else:
            square = dx * dx + dy * dy + dz * dz
            # An open contact of two spheres needs no root; most are open.
            shut = kind != CONTACT or s.elastic[i] != 0.0 or s.z[i] != 0.0
            if not shut and square >= s.rest[i] * s.rest[i]:
                continue
            r = math.sqrt(square)
            d = r - s.rest[i]
            nx = ny = nz = 0.0
            if r > 0.0:
                nx = dx / r
                ny = dy / r
                nz = dz / r
        moved = (
            way[at] * (dx - apart[at])
            + way[at + 1] * (dy - apart[at + 1])
            + way[at + 2] * (dz - apart[at + 2])
        )
        apart[at] = dx
        apart[at + 1] = dy
        apart[at + 2] = dz
        way[at] = nx
        way[at + 1] = ny
        way[at + 2] = nz
        before = s.tension[i]
        w = nx * (v[one] - v[two]) + ny * (v[one + 1] - v[two + 1])
        w = w + nz * (v[one + 2] - v[two + 2])
        if kind >= FRICTION:
            if kind in (NEGATIVE, SOURCE):
                s.made[i] -= before * moved
            else:
                s.lost[i] += before * moved
            pull, _ = rate_tension(kind, s.z[i], s.limit[i], s.scale[i], w)
        else:
            pull = 0.0
            k = s.k[i]
            if k > 0.0:
                held = s.elastic[i]
                free = elastic_energy(kind, k, s.e[i], d - s.set_in[i])
                s.numeric[i] += free - s.stored[i] - held * moved
                s.lost[i] += (before - held) * moved
                if kind == PLASTIC:
                    s.set_in[i] = yielded(k, s.limit[i], d, s.set_in[i])
                    stored = elastic_energy(kind, k, 1.0, d - s.set_in[i])
                    s.lost[i] += free - stored
                    free = stored
                s.stored[i] = free
                pull = elastic_tension(kind, k, s.e[i], d - s.set_in[i])
                s.elastic[i] = pull
                if s.loss[i] > 0.0:
                    factor = 1.0 - s.loss[i] * w
                    if factor < 0.0:
                        factor = 0.0
                    pull = pull * factor
            else:
                s.lost[i] += before * moved
            pull = pull + s.z[i] * w
        s.stretch[i] = d
        s.tension[i] = pull
        force[one] -= pull * nx
        force[one + 1] -= pull * ny
        force[one + 2] -= pull * nz
        force[two] += pull * nx
        force[two + 1] += pull * ny
        force[two + 2] += pull * nz


def step_network3d(s: Arrays3d, period: float) -> None:
    """Advance all masses by one step [s], by the forces that `set_forces3d` set."""
    x, v, force = s.x, s.v, s.force
    for m in range(s.count[0]):
        gain = period * s.mobility[m]
        drag = s.drag[m]
        for at in range(3 * m, 3 * m + 3):
            speed = v[at]
            brake = drag * speed
            total = force[at] + s.weight[at] + s.pushed[at] - brake
            gained = gain * total
            speed = speed + gained
            moved = period * speed
            v[at] = speed
            x[at] = x[at] + moved
            s.dragged[m] += brake * moved
            s.pumped[m] += s.pushed[at] * moved
            s.mass_numeric[m] -= 0.5 * total * period * gained


def place_port(s: Arrays3d, port: int, axes_at: list[float], period: float) -> None:
    """Put a port at its axes' positions [m]; its speed is the displacement over a period."""
    node = 3 * (s.count[0] + port)
    for c in range(3):
        where = s.origin[3 * port + c]
        for axis in range(s.count[3]):
            if s.axis_port[axis] == port:
                where = where + axes_at[axis] * s.axis_way[3 * axis + c]
        s.v[node + c] = (where - s.x[node + c]) / period
        s.x[node + c] = where


def move_port3d(s: Arrays3d, port: int, axes_at: list[float], period: float) -> None:
    """Move a port to its axes' positions; book the work of the force that acted meanwhile."""
    node = 3 * (s.count[0] + port)
    before = (s.x[node], s.x[node + 1], s.x[node + 2])
    place_port(s, port, axes_at, period)
    for c in range(3):
        s.port_work[port] -= s.force[node + c] * (s.x[node + c] - before[c])


def axis_effort(s: Arrays3d, axis: int) -> float:
    """Return the resisting effort on an axis [N]: the force on its port, against its direction."""
    node = 3 * (s.count[0] + s.axis_port[axis])
    effort = 0.0
    for c in range(3):
        effort = effort - s.force[node + c] * s.axis_way[3 * axis + c]
    return effort
