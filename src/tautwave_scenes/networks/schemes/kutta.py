"""Kutta's classical step of a network: fourth order where its motion is smooth, with its books.

A port moves linearly from its last to its present position, so the network is advanced to the
present, and its forces are those at the end of the step. Stable for w T < 2.8; of a linear mode the
step takes (w T)**6 / 72 of its energy and never makes any. Across a contact's edge the order is
that of the contact's exponent plus one. Powers are integrated with the weights of the step; any
excess energy of a link or a mass is booked as the scheme's (`numeric`). Hairer, Norsett, Wanner,
II.1.

Plain Python on lists, or compiled by numba.
"""

from __future__ import annotations

from tautwave_scenes.models.interaction import (
    CONTACT,
    FRICTION,
    NEGATIVE,
    elastic_energy,
    elastic_tension,
    rate_tension,
)
from tautwave_scenes.networks.compiling import Arrays


def aim_ports(s: Arrays, port: int, position: float, period: float) -> None:
    """Let a port move to its device's position in the coming step."""
    at = s.count[0] + port
    s.v[at] = (position - s.x[at]) / period


def step_kutta(s: Arrays, period: float) -> None:
    """Advance masses and ports by one step [s]; `force` then holds the links' new forces."""
    n = s.count[0]
    ports = n + s.count[1]
    x, v, force, work = s.x, s.v, s.force, s.work
    for m in range(n):
        work[m] = x[m]
        work[n + m] = v[m]
        work[2 * n + m] = 0.0
        work[3 * n + m] = 0.0
    for stage in range(4):
        share = period / 6.0 if stage in (0, 3) else period / 3.0
        ahead = 0.5 * period if stage < 2 else period
        pull_stage(s, share)
        for m in range(n):
            speed = v[m]
            brake = s.drag[m] * speed
            total = force[m] + s.weight[m] + s.pushed[m] - brake
            gain = s.mobility[m] * total
            work[2 * n + m] += share * speed
            work[3 * n + m] += share * gain
            s.dragged[m] += share * brake * speed
            s.pumped[m] += share * s.pushed[m] * speed
            s.mass_numeric[m] -= share * total * speed
            x[m] = work[m] + ahead * speed
            v[m] = work[n + m] + ahead * gain
        for at in range(n, ports):
            s.port_work[at - n] -= share * force[at] * v[at]
            if stage in (0, 2):
                x[at] += 0.5 * period * v[at]
    for m in range(n):
        before = work[n + m]
        gained = work[3 * n + m]
        x[m] = work[m] + work[2 * n + m]
        v[m] = before + gained
        s.mass_numeric[m] += s.mass[m] * gained * (before + 0.5 * gained)
    pull_stage(s, 0.0)
    for i in range(s.count[2]):
        if s.kind[i] >= FRICTION or s.k[i] == 0.0:
            continue
        d = x[s.a[i]] - x[s.b[i]] - s.rest[i]
        if s.kind[i] == CONTACT and d >= 0.0 and s.stored[i] == 0.0:
            continue
        stored = elastic_energy(s.kind[i], s.k[i], s.e[i], d)
        s.numeric[i] += stored - s.stored[i]
        s.stored[i] = stored


def pull_stage(s: Arrays, share: float) -> None:
    """Set the forces at the present state; book their powers over `share` of the step [s]."""
    x, v, force = s.x, s.v, s.force
    for i in range(s.count[0] + s.count[1]):
        force[i] = 0.0
    for i in range(s.count[2]):
        one = s.a[i]
        two = s.b[i]
        kind = s.kind[i]
        d = x[one] - x[two] - s.rest[i]
        if kind == CONTACT and d >= 0.0:
            s.tension[i] = 0.0
            continue
        w = v[one] - v[two]
        if kind >= FRICTION:
            pull, _ = rate_tension(kind, s.z[i], s.limit[i], s.scale[i], w)
            if kind < NEGATIVE:
                s.lost[i] += share * pull * w
            else:
                s.made[i] -= share * pull * w
        else:
            elastic = 0.0
            if s.k[i] > 0.0:
                elastic = elastic_tension(kind, s.k[i], s.e[i], d)
            pull = elastic + s.z[i] * w
            if s.loss[i] > 0.0:
                pull = elastic * max(1.0 - s.loss[i] * w, 0.0)
            s.lost[i] += share * (pull - elastic) * w
            s.numeric[i] -= share * elastic * w
        s.tension[i] = pull
        force[one] -= pull
        force[two] += pull
