"""Masses that are linked to each other, moved together: Newton with conjugate gradients.

The Jacobian is 2 m / T**2 + c / T on the diagonal and a Laplacian of the links' slopes: symmetric,
and positive unless a link feeds energy. Each island is solved by itself, so none changes a bit of
another. Scratch rows of `Arrays.work`: 0 movement, 1 residual, 2 diagonal, 3 direction, 4 rest, 5
Jacobian times direction, 6 correction, 7 movement without links.
"""

from __future__ import annotations

import math

from tautwave_scenes.networks.compiling import Arrays
from tautwave_scenes.networks.schemes.tension import (
    book_link,
    commit_mass,
    free_movement,
    link_pull,
)

_NEWTON = 30
_DONE = 2e-15
_FLOOR = 1e-12


def _owned(s: Arrays, i: int, m: int) -> bool:
    """Whether mass `m` is the end that processes link `i`."""
    return bool(s.a[i] == m or s.a[i] >= s.count[0])


def _apart(s: Arrays, i: int, at: int) -> float:
    """Return the change of a link's stretch by a scratch row (given by its offset)."""
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
        base = 2.0 * s.mass[m] / (period * period) + s.drag[m] / period
        free = s.work[7 * n + m]
        s.work[n + m] = base * (s.work[m] - free)
        s.work[2 * n + m] = base
        size = math.fabs(base * s.work[m]) + math.fabs(base * free)
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
        free = free_movement(s, m, base, period)
        s.work[m] = free
        s.work[7 * n + m] = free
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
            for _ in range(10):  # overshoot across a kink: halve the step until the residual falls
                for at in range(first, last):
                    m = s.islands[at]
                    s.work[6 * n + m] = 0.5 * s.work[6 * n + m]
                    s.work[m] -= s.work[6 * n + m]
                worst, scale = _residual(s, first, last, period)
                if worst < before:
                    break
    for at in range(first, last):
        m = s.islands[at]
        commit_mass(s, m, s.work[m], period)
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if _owned(s, i, m):
                book_link(s, i, _apart(s, i, 0), s.tension[i], period)
    return tries
