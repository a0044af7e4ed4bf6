"""The discrete-gradient step: energy is kept by every elastic link at any stiffness.

Over a step every mass moves by s at the mean velocity s/T; links pull with their discrete gradient,
dampers and friction with the mean rate, so that

    (2 m / T**2)(s - T v) + c s / T + pulls(s) = outside force,      v' = 2 s/T - v.

A port stands where it is for the whole step; that it jumped there is booked with the links' stored
energy, its speed counts for dampers only. A mass linked to no other is one increasing equation
(Newton between brackets); masses linked to each other are solved an island at a time (Newton,
conjugate gradients on a Laplacian, Jacobi preconditioned), so no island changes a bit of another.
A node may be without mass where something damps it (`drag`): the end of a string.

Source: Chatziioannou & van Walstijn 2015. Plain Python on lists, or compiled by numba.
"""

from __future__ import annotations

import math

from tautwave.models.interaction import (
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
from tautwave.scene.compiling import Arrays

_CLOSE = 1e-15
_TRIES = 60
_NEWTON = 30
_DONE = 2e-15
_FLOOR = 1e-12


def jump_ports(s: Arrays, port: int, position: float, period: float) -> None:
    """Put a port where its device is; what its links store more or less is its work."""
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
    given = 0.0  # what ports moved, as far as rates count
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


def step_gradient(s: Arrays, period: float) -> int:
    """Advance all masses by one step [s]; `force` then holds what the links pulled in it.

    Returns
    -------
    int
        Greatest number of iterations any equation took; 0 where all were free.
    """
    most = 0
    masses = s.count[0]
    for i in range(masses, masses + s.count[1]):
        s.force[i] = 0.0
    for m in s.alone:
        s.force[m] = 0.0
        inertia = 2.0 * s.mass[m] / (period * period)
        base = inertia + s.drag[m] / period
        push = s.weight[m] + s.pushed[m] + inertia * period * s.v[m]
        free = push / base
        first = s.links_first[m]
        last = s.links_first[m + 1]
        touched = False
        for j in range(first, last):
            i = s.links_of[j]
            if s.kind[i] == CONTACT and s.z[i] == 0.0:
                d = s.x[s.a[i]] - s.x[s.b[i]] - s.rest[i]
                if d >= 0.0:
                    d = d + free if s.a[i] == m else d - free
                    if d >= 0.0:
                        s.tension[i] = 0.0
                        continue
            touched = True
            break
        moved = free
        if touched:
            moved, tries = solve_alone(s, m, base, push, free, period)
            if tries > most:
                most = tries
        if touched:
            for j in range(first, last):
                i = s.links_of[j]
                s.tension[i], _ = link_pull(s, i, moved if s.a[i] == m else -moved, period)
        _commit(s, m, moved, period)
        if touched:
            for j in range(first, last):
                i = s.links_of[j]
                book_link(s, i, moved if s.a[i] == m else -moved, s.tension[i], period)
    for island in range(len(s.island_first) - 1):
        tries = solve_island(s, s.island_first[island], s.island_first[island + 1], period)
        if tries > most:
            most = tries
    return most


def solve_alone(
    s: Arrays, m: int, base: float, push: float, free: float, period: float
) -> tuple[float, int]:
    """Movement of a mass that is linked to no other mass, and how often it was improved."""
    low = -math.inf
    high = math.inf
    at = free
    tries = 0
    while tries < _TRIES:
        tries += 1
        rest = base * at - push
        slope = base
        size = math.fabs(base * at) + math.fabs(push)
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if s.a[i] == m:
                pull, steep = link_pull(s, i, at, period)
                rest = rest + pull
            else:
                pull, steep = link_pull(s, i, -at, period)
                rest = rest - pull
            slope = slope + steep
            size = size + math.fabs(pull)
        if math.fabs(rest) <= _CLOSE * size:
            break
        if rest > 0.0:
            high = at
        else:
            low = at
        change = -rest / slope
        if slope <= 0.0 or at + change <= low or at + change >= high:
            if high < math.inf and low > -math.inf:
                change = 0.5 * (low + high) - at
            elif slope <= 0.0:
                change = -rest / base
        if at + change == at:
            break
        at = at + change
    return at, tries


def _commit(s: Arrays, m: int, moved: float, period: float) -> None:
    """Move a mass."""
    s.x[m] = s.x[m] + moved
    rate = moved / period
    s.dragged[m] += s.drag[m] * rate * moved
    s.pumped[m] += s.pushed[m] * moved
    if s.mass[m] > 0.0:
        s.v[m] = 2.0 * rate - s.v[m]
    else:
        s.v[m] = rate


def _owned(s: Arrays, i: int, m: int) -> bool:
    """Whether mass `m` is the one of its two ends that visits link `i`."""
    return bool(s.a[i] == m or s.a[i] >= s.count[0])


def _apart(s: Arrays, i: int, at: int) -> float:
    """Return by how much a scratch row (its offset) moves the ends of a link apart."""
    one = s.a[i]
    two = s.b[i]
    masses = s.count[0]
    moved = 0.0
    if one < masses:
        moved = s.work[at + one]
    if two < masses:
        moved = moved - s.work[at + two]
    return moved


def _residual(s: Arrays, first: int, last: int, period: float) -> tuple[float, float]:
    """Fill residual (row 1) and diagonal (row 2) at the movement (row 0); its size, and a scale."""
    n = s.count[0]
    worst = 0.0
    scale = 0.0
    for at in range(first, last):
        m = s.islands[at]
        inertia = 2.0 * s.mass[m] / (period * period)
        base = inertia + s.drag[m] / period
        push = s.weight[m] + s.pushed[m] + inertia * period * s.v[m]
        s.work[n + m] = base * s.work[m] - push
        s.work[2 * n + m] = base
        size = math.fabs(base * s.work[m]) + math.fabs(push)
        if size > scale:
            scale = size
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if not _owned(s, i, m):
                continue
            pull, slope = link_pull(s, i, _apart(s, i, 0), period)
            s.tension[i] = pull
            s.slope[i] = slope
            if math.fabs(pull) > scale:
                scale = math.fabs(pull)
            one = s.a[i]
            two = s.b[i]
            if one < n:
                s.work[n + one] += pull
                s.work[2 * n + one] += slope
            if two < n:
                s.work[n + two] -= pull
                s.work[2 * n + two] += slope
    for at in range(first, last):
        size = math.fabs(s.work[n + s.islands[at]])
        if size > worst:
            worst = size
    return worst, scale


def _times(s: Arrays, first: int, last: int, period: float) -> float:
    """Fill row 5 with the Jacobian times row 3; return row 3 times row 5."""
    n = s.count[0]
    for at in range(first, last):
        m = s.islands[at]
        base = 2.0 * s.mass[m] / (period * period) + s.drag[m] / period
        s.work[5 * n + m] = base * s.work[3 * n + m]
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if not _owned(s, i, m):
                continue
            pull = s.slope[i] * _apart(s, i, 3 * n)
            if s.a[i] < n:
                s.work[5 * n + s.a[i]] += pull
            if s.b[i] < n:
                s.work[5 * n + s.b[i]] -= pull
    total = 0.0
    for at in range(first, last):
        m = s.islands[at]
        total += s.work[3 * n + m] * s.work[5 * n + m]
    return total


def _conjugate(s: Arrays, first: int, last: int, period: float) -> None:
    """Solve Jacobian times row 6 = -row 1 by preconditioned conjugate gradients."""
    n = s.count[0]
    before = 0.0
    for at in range(first, last):
        m = s.islands[at]
        rest = -s.work[n + m]
        s.work[4 * n + m] = rest
        s.work[6 * n + m] = 0.0
        s.work[3 * n + m] = rest / s.work[2 * n + m]
        before += rest * s.work[3 * n + m]
    begun = before
    for _ in range(4 * (last - first) + 8):
        if not before > 1e-30 * begun:
            break
        along = _times(s, first, last, period)
        if not along > 0.0:
            break
        step = before / along
        after = 0.0
        for at in range(first, last):
            m = s.islands[at]
            s.work[6 * n + m] += step * s.work[3 * n + m]
            rest = s.work[4 * n + m] - step * s.work[5 * n + m]
            s.work[4 * n + m] = rest
            after += rest * rest / s.work[2 * n + m]
        share = after / before
        before = after
        for at in range(first, last):
            m = s.islands[at]
            s.work[3 * n + m] = s.work[4 * n + m] / s.work[2 * n + m] + share * s.work[3 * n + m]


def solve_island(s: Arrays, first: int, last: int, period: float) -> int:
    """Move the masses islands[first:last], which are linked to each other; return iterations."""
    n = s.count[0]
    for at in range(first, last):
        m = s.islands[at]
        s.force[m] = 0.0
        base = 2.0 * s.mass[m] / (period * period) + s.drag[m] / period
        push = s.weight[m] + s.pushed[m] + 2.0 * s.mass[m] * s.v[m] / period
        s.work[m] = push / base
    worst, scale = _residual(s, first, last, period)
    tries = 0
    while tries < _NEWTON and worst > _DONE * scale:
        tries += 1
        _conjugate(s, first, last, period)
        for at in range(first, last):
            m = s.islands[at]
            s.work[m] += s.work[6 * n + m]
        before = worst
        worst, scale = _residual(s, first, last, period)
        if worst >= before:
            if before <= _FLOOR * scale:
                break
            for _ in range(10):  # too far over a kink: back by half, until it pays
                for at in range(first, last):
                    m = s.islands[at]
                    s.work[6 * n + m] = 0.5 * s.work[6 * n + m]
                    s.work[m] -= s.work[6 * n + m]
                worst, scale = _residual(s, first, last, period)
                if worst < before:
                    break
    for at in range(first, last):
        m = s.islands[at]
        _commit(s, m, s.work[m], period)
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if _owned(s, i, m):
                book_link(s, i, _apart(s, i, 0), s.tension[i], period)
    return tries
