"""The discrete-gradient step: energy is kept by every elastic link at any stiffness.

Over a step every mass moves by s at the mean velocity s/T; links pull with their discrete gradient,
dampers and friction with the mean rate, so that

    (2 m / T**2)(s - T v) + c s / T + pulls(s) = external force,      v' = v + 2 (s - T v)/T.

Solved as (2 m / T**2 + c / T)(s - free) + pulls(s) = 0: so a free mass keeps its
speed to the bit, and a bouncing one returns all its energy, however many steps that takes.

A port stands still for the whole step; its jump is booked as a change of the links' stored energy,
and its speed counts only for dampers. A mass linked to no other is one increasing equation (Newton
between brackets); masses linked to each other are solved an island at a time (Newton, conjugate
gradients on a Laplacian, Jacobi preconditioned), so no island changes a bit of another. A damped
node (`drag`) may be massless: the end of a string.

Source: Chatziioannou & van Walstijn 2015. Plain Python on lists, or compiled by numba.
"""

from __future__ import annotations

import math

from tautwave_scenes.models.interaction import CONTACT
from tautwave_scenes.networks.compiling import Arrays
from tautwave_scenes.networks.schemes.islands import solve_island
from tautwave_scenes.networks.schemes.tension import (
    book_link,
    commit_mass,
    free_movement,
    link_pull,
)

_CLOSE = 1e-15
_FAR = 1e-12
_TRIES = 200


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
        base = 2.0 * s.mass[m] / (period * period) + s.drag[m] / period
        free = free_movement(s, m, base, period)
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
            moved, tries = solve_alone(s, m, base, free, period)
            if tries > most:
                most = tries
        if touched:
            for j in range(first, last):
                i = s.links_of[j]
                s.tension[i], _ = link_pull(s, i, moved if s.a[i] == m else -moved, period)
        commit_mass(s, m, moved, period)
        if touched:
            for j in range(first, last):
                i = s.links_of[j]
                book_link(s, i, moved if s.a[i] == m else -moved, s.tension[i], period)
    for island in range(len(s.island_first) - 1):
        tries = solve_island(s, s.island_first[island], s.island_first[island + 1], period)
        if tries > most:
            most = tries
    for i in range(s.count[2]):
        if s.a[i] >= masses and s.b[i] >= masses:  # a wall right at a port: no mass visits it
            pull, _ = link_pull(s, i, 0.0, period)
            book_link(s, i, 0.0, pull, period)
    return most


def solve_alone(s: Arrays, m: int, base: float, free: float, period: float) -> tuple[float, int]:
    """Movement of a mass linked to no other mass, and the number of iterations."""
    low = -math.inf
    high = math.inf
    at = free
    before = math.inf
    tries = 0
    while tries < _TRIES:
        tries += 1
        rest = base * (at - free)
        slope = base
        size = math.fabs(base * at) + math.fabs(base * free)
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
            if slope > 0.0:  # Newton ends on one side; a thousand steps would add it up
                at = at - rest / slope
            break
        if rest > 0.0:
            high = at
        else:
            low = at
        change = -rest / slope
        # Between a falling and a rising piece of a friction curve Newton oscillates indefinitely.
        stuck = math.fabs(rest) > 0.5 * before and math.fabs(rest) > _FAR * size
        before = math.fabs(rest)
        if slope <= 0.0 or stuck or at + change <= low or at + change >= high:
            if high < math.inf and low > -math.inf:
                change = 0.5 * (low + high) - at
            elif slope <= 0.0:
                change = -rest / base
        if at + change == at:
            break
        at = at + change
    return at, tries
