"""A link in a discrete-gradient step: its mean tension, and its books."""

from __future__ import annotations

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
from tautwave_scenes.networks.compiling import Arrays


def jump_ports(s: Arrays, port: int, position: float, period: float) -> None:
    """Put a port at its device's position; the change in its links' stored energy is its work."""
    at = s.count[0] + port
    s.v[at] = (position - s.x[at]) / period
    s.x[at] = position
    work = 0.0
    for i in range(s.count[2]):
        if s.a[i] != at and s.b[i] != at:
            continue
        kind = s.kind[i]
        if kind >= FRICTION or s.k[i] == 0.0:
            continue
        d = s.x[s.a[i]] - s.x[s.b[i]] - s.rest[i]
        if kind == CONTACT and d >= 0.0 and s.stored[i] == 0.0:
            continue
        if kind == PLASTIC:
            d = d - s.set_in[i]
        stored = elastic_energy(kind, s.k[i], s.e[i], d)
        work += stored - s.stored[i]
        s.stored[i] = stored
    s.port_work[port] += work


def link_pull(s: Arrays, i: int, moved: float, period: float) -> tuple[float, float]:
    """Mean tension of a link whose masses move apart by `moved` in the step, and its derivative."""
    one = s.a[i]
    two = s.b[i]
    masses = s.count[0]
    kind = s.kind[i]
    w = moved / period
    if one >= masses:
        w = w + s.v[one]
    if two >= masses:
        w = w - s.v[two]
    if kind >= FRICTION:
        pull, slope = rate_tension(kind, s.z[i], s.limit[i], s.scale[i], w)
        return pull, slope / period
    pull = 0.0
    slope = 0.0
    if s.k[i] > 0.0:
        d = s.x[one] - s.x[two] - s.rest[i]
        if kind == PLASTIC:
            d = d - s.set_in[i]
        pull, slope = mean_tension(kind, s.k[i], s.e[i], d, moved)
        if s.loss[i] > 0.0:
            pull, slope = lossy_contact(pull, slope, s.loss[i], w, 1.0 / period)
    if s.z[i] > 0.0:
        pull = pull + s.z[i] * w
        slope = slope + s.z[i] / period
    return pull, slope


def book_link(s: Arrays, i: int, moved: float, pull: float, period: float) -> None:
    """Book a link after its masses have moved; `pull` is its mean tension in the step."""
    one = s.a[i]
    two = s.b[i]
    masses = s.count[0]
    kind = s.kind[i]
    s.tension[i] = pull
    s.force[one] -= pull
    s.force[two] += pull
    given = 0.0  # movement of ports, which matters only for rates
    if one >= masses:
        given = given + period * s.v[one]
    if two >= masses:
        given = given - period * s.v[two]
    swept = moved + given
    if kind >= FRICTION:
        if kind < NEGATIVE:
            s.lost[i] += pull * swept
        else:
            s.made[i] -= pull * swept
        rate = pull
    else:
        stored = 0.0
        rate = pull
        if s.k[i] > 0.0:
            d = s.x[one] - s.x[two] - s.rest[i]
            start = d - moved
            if kind == PLASTIC:
                start = start - s.set_in[i]
                d = d - s.set_in[i]
            mean, _ = mean_tension(kind, s.k[i], s.e[i], start, moved)
            stored = elastic_energy(kind, s.k[i], s.e[i], d)
            rate = pull - mean
            if kind == PLASTIC:
                set_in = yielded(s.k[i], s.limit[i], d + s.set_in[i], s.set_in[i])
                less = elastic_energy(kind, s.k[i], 1.0, d + s.set_in[i] - set_in)
                s.lost[i] += stored - less
                stored = less
                s.set_in[i] = set_in
        s.stored[i] = stored
        s.lost[i] += rate * swept
    if given != 0.0:
        if one >= masses and one < masses + s.count[1]:
            s.port_work[one - masses] += rate * period * s.v[one]
        if two >= masses and two < masses + s.count[1]:
            s.port_work[two - masses] -= rate * period * s.v[two]


def free_movement(s: Arrays, m: int, base: float, period: float) -> float:
    """Movement of a mass in the step without link forces; `base` is 2 m / T**2 + c / T."""
    outside = s.weight[m] + s.pushed[m]
    if s.mass[m] == 0.0:
        return float(outside / base)
    glide = period * s.v[m]
    return float(glide + (outside - s.drag[m] * s.v[m]) / base)


def commit_mass(s: Arrays, m: int, moved: float, period: float) -> None:
    """Move a mass."""
    s.x[m] = s.x[m] + moved
    rate = moved / period
    s.dragged[m] += s.drag[m] * rate * moved
    s.pumped[m] += s.pushed[m] * moved
    if s.mass[m] > 0.0:
        s.v[m] = s.v[m] + 2.0 * (moved - period * s.v[m]) / period
    else:
        s.v[m] = rate
