"""The standard mass-interaction step: symplectic Euler over flat arrays, with its energy books.

Links compute forces from positions and velocities, masses the next positions from forces; ports
move as prescribed. A force is held over a step, so a port takes exactly the energy that its device
delivers: force of the last step times displacement. The energy that holding a force creates or
takes (`numeric`) is booked where it occurs: at each link, stored energy minus tension times
stretch; at each mass, half T**2 f**2 / m. Stable for w T < 2. Plain Python on lists, or compiled by
numba.
"""

from __future__ import annotations

from tautwave_scenes.models.interaction import (
    FRICTION,
    NEGATIVE,
    PLASTIC,
    SOURCE,
    elastic_energy,
    elastic_tension,
    rate_tension,
    yielded,
)
from tautwave_scenes.networks.compiling import Arrays


def pull_links(s: Arrays) -> None:
    """Book the work of every link since the last call, and set the forces at the present state."""
    x, v, force = s.x, s.v, s.force
    tension, stretch = s.tension, s.stretch
    masses, contacts, links = s.count[0], s.count[3], s.count[2]
    for i in range(masses):
        force[i] = 0.0
    for i in range(masses, masses + s.count[1]):
        force[i] = 0.0
    for i in range(contacts):  # first in the order of the arrays: most of them are open
        one = s.a[i]
        two = s.b[i]
        d = x[one] - x[two] - s.rest[i]
        elastic = s.set_in[i]
        if d >= 0.0 and elastic == 0.0:
            continue
        before = tension[i]
        kind = s.kind[i]
        moved = d - stretch[i]
        stretch[i] = d
        stored = elastic_energy(kind, s.k[i], s.e[i], d)
        # Tension times movement is split into the elastic share (set_in) and the loss.
        s.numeric[i] += stored - s.stored[i] - elastic * moved
        s.lost[i] += (before - elastic) * moved
        s.stored[i] = stored
        pull = elastic_tension(kind, s.k[i], s.e[i], d)
        s.set_in[i] = pull
        if s.loss[i] > 0.0:
            factor = 1.0 - s.loss[i] * (v[one] - v[two])
            if factor < 0.0:
                factor = 0.0
            pull = pull * factor
        tension[i] = pull
        force[one] -= pull
        force[two] += pull
    for i in range(contacts, links):
        one = s.a[i]
        two = s.b[i]
        kind = s.kind[i]
        d = x[one] - x[two] - s.rest[i]
        moved = d - stretch[i]
        stretch[i] = d
        before = tension[i]
        w = v[one] - v[two]
        if kind >= FRICTION:
            if kind in (NEGATIVE, SOURCE):
                s.made[i] -= before * moved
            else:
                s.lost[i] += before * moved
            pull, _ = rate_tension(kind, s.z[i], s.limit[i], s.scale[i], w)
        else:
            k = s.k[i]
            elastic = 0.0
            if k > 0.0:
                if kind == PLASTIC:
                    held = k * (d - moved - s.set_in[i])
                    set_in = yielded(k, s.limit[i], d, s.set_in[i])
                    free = elastic_energy(kind, k, 1.0, d - s.set_in[i])
                    stored = elastic_energy(kind, k, 1.0, d - set_in)
                    s.lost[i] += free - stored
                    s.numeric[i] += free - s.stored[i] - held * moved
                    s.lost[i] += (before - held) * moved
                    s.set_in[i] = set_in
                    elastic = k * (d - set_in)
                else:
                    held = elastic_tension(kind, k, s.e[i], d - moved)
                    stored = elastic_energy(kind, k, s.e[i], d)
                    s.numeric[i] += stored - s.stored[i] - held * moved
                    s.lost[i] += (before - held) * moved
                    elastic = elastic_tension(kind, k, s.e[i], d)
                s.stored[i] = stored
            else:
                s.lost[i] += before * moved
            pull = elastic + s.z[i] * w
        tension[i] = pull
        force[one] -= pull
        force[two] += pull


def step_symplectic(s: Arrays, period: float) -> None:
    """Advance all masses by one step [s], by the forces that `pull_links` set."""
    x, v, force = s.x, s.v, s.force
    for i in range(s.count[0]):
        speed = v[i]
        pushed = s.pushed[i]
        brake = s.drag[i] * speed
        total = force[i] + s.weight[i] + pushed - brake
        gained = period * s.mobility[i] * total
        speed = speed + gained
        moved = period * speed
        v[i] = speed
        x[i] = x[i] + moved
        if brake != 0.0:
            s.dragged[i] += brake * moved
        s.pumped[i] += pushed * moved
        s.mass_numeric[i] -= 0.5 * total * period * gained


def move_ports(s: Arrays, port: int, position: float, period: float) -> None:
    """Move a port to its device's position; book the work of the force that acted meanwhile."""
    at = s.count[0] + port
    moved = position - s.x[at]
    s.port_work[port] -= s.force[at] * moved
    s.x[at] = position
    s.v[at] = moved / period


INLINED = (move_ports, pull_links, step_symplectic)
"""What runs in every step, is called in a place, and costs little more than a call."""
