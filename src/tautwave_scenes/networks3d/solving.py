"""The discrete-gradient step in 3D: keeps energy, momentum and angular momentum at any stiffness.

Over a step every mass moves by s at the mean velocity s/T (see `networks.schemes.gradient`),
and (2 m / T**2 + c / T)(s - free) + pulls(s) = 0 is solved an island at a time: Newton, its
equations by stabilised biconjugate gradients (the derivative of a turning pull is not symmetric),
Jacobi preconditioned, backtracking. If that does not converge, the step is halved, down to a 64th:
in a short step inertia dominates every smooth force. The last resort, for a 64th that does not
converge, is s = 0: all velocities of the island are reversed in place, as at a wall. That creates
no energy.

Elements of tissue have a matrix that is dear, and not the exact derivative (it leaves out how the
mean rotation turns): it is made in the first two iterations and then kept while each makes the
residual smaller than `_POOR` of the one before, which it does to a thirtieth. An iteration after
the residual is below `_LAST` would find nothing but rounding, and is not made.

With one iteration (`ONE`) the step is linearly implicit: one linear solve from the movement without
links, whatever its residual. The residual times the movement is the energy that this created, and
is booked as `numeric` of the masses.

Scratch rows of `work`, 3 n numbers each: 0 movement, 1 residual, 2 diagonal, 3 direction, 4 rest,
5 Jacobian times 10, 6 correction, 7 movement without links, 8 first rest, 9 as 5 for the second
half, 10 preconditioned. Plain Python on lists, or compiled by numba.
"""

from __future__ import annotations

import math

from tautwave_scenes.networks3d.arrays import Arrays3d
from tautwave_scenes.networks3d.straining import (
    add_diagonal,
    commit_elements,
    pull_elements,
    shape_matrix,
    times_elements,
)
from tautwave_scenes.networks3d.tension import book_link3d, pull_link

NEWTON = 30
ONE = 1
PIECES = 64
_DONE = 5e-16
_FLOOR = 1e-12
_INNER = 1e-8
"""Squared tolerance of the inner equations, relative to their initial residual."""

_ROUGH = 1e-3
"""The same with elements: their matrix is an approximation, and kept while it serves."""

_POOR = 0.1
_LAST = 1e-14
"""A residual, relative to its scale, that a matrix which is kept takes to rounding."""


def step_gradient3d(s: Arrays3d, period: float, newton: int) -> int:
    """Advance all masses by one step [s]; `force` then holds the mean force of the links in it.

    Parameters
    ----------
    s : Arrays3d
        The network.
    period : float
        T [s].
    newton : int
        Greatest number of iterations: NEWTON, or ONE.

    Returns
    -------
    int
        Greatest number of Newton's iterations of an island, all pieces of its step together.
    """
    most = 0
    for at in range(3 * (s.count[0] + s.count[1])):
        s.force[at] = 0.0
    for island in range(len(s.island_first) - 1):
        first = s.island_first[island]
        last = s.island_first[island + 1]
        done = 0
        size = PIECES
        tries = 0
        while done < PIECES:
            share = size / PIECES
            count, solved = solve_step3d(s, first, last, share * period, newton)
            tries += count
            if not solved and size > 1:
                size = size // 2
                continue
            if not solved:
                turn_round(s, first, last, share * period)
            if newton == ONE:
                book_defect(s, first, last)
            commit_step3d(s, first, last, share * period, share)
            done += size
        if tries > most:
            most = tries
    for i in range(s.count[2]):
        if s.a[i] >= s.count[0] and s.b[i] >= s.count[0]:  # at a port: no mass visits it
            pull_link(s, i, 0, period)
            book_link3d(s, i, period, 1.0)
    return most


def _owned(s: Arrays3d, i: int, m: int) -> bool:
    """Whether mass `m` is the end that processes link `i`."""
    return bool(s.a[i] == m or s.a[i] >= s.count[0])


def _base(s: Arrays3d, m: int, period: float) -> float:
    return float(2.0 * s.mass[m] / (period * period) + s.drag[m] / period)


def residual_of(s: Arrays3d, first: int, last: int, period: float) -> tuple[float, float]:
    """Fill residual and diagonal at the movement; return the residual's size, and a scale."""
    n = 3 * s.count[0]
    work = s.work
    worst = 0.0
    scale = 0.0
    for at in range(first, last):
        m = s.islands[at]
        base = _base(s, m, period)
        for c in range(3 * m, 3 * m + 3):
            work[n + c] = base * (work[c] - work[7 * n + c])
            work[2 * n + c] = base
            size = math.fabs(base * work[c]) + math.fabs(base * work[7 * n + c])
            if size > scale:
                scale = size
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if not _owned(s, i, m):
                continue
            pull_link(s, i, 0, period)
            pull = s.tension[i]
            if pull == 0.0 and s.side[i] == 0.0 and s.bend[3 * i] == 0.0:
                continue
            if math.fabs(pull) > scale:
                scale = math.fabs(pull)
            one = 3 * s.a[i]
            two = 3 * s.b[i]
            for c in range(3):
                part = pull * s.way[3 * i + c]
                slope = s.way[3 * i + c] * s.bend[3 * i + c] + s.side[i]
                if one < n:
                    work[n + one + c] += part
                    work[2 * n + one + c] += slope
                if two < n:
                    work[n + two + c] -= part
                    work[2 * n + two + c] += slope
    strained = pull_elements(s, first, last, period)
    if strained > scale:
        scale = strained
    for at in range(first, last):
        m = s.islands[at]
        base = _base(s, m, period)
        for c in range(3 * m, 3 * m + 3):
            size = math.fabs(work[n + c])
            if not size <= worst:  # NaN as well
                worst = size
            if not work[2 * n + c] > 0.5 * base:
                work[2 * n + c] = base
    return worst, scale


def _times(s: Arrays3d, first: int, last: int, period: float, given: int, to: int) -> None:
    """Precondition row `given` into row 10, and fill row `to` with the Jacobian times that."""
    n = 3 * s.count[0]
    work = s.work
    ten = 10 * n
    for at in range(first, last):
        m = s.islands[at]
        base = _base(s, m, period)
        for c in range(3 * m, 3 * m + 3):
            along = work[given * n + c] / work[2 * n + c]
            work[ten + c] = along
            work[to * n + c] = base * along
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            at3 = 3 * i
            side = s.side[i]
            if not _owned(s, i, m) or (side == 0.0 and s.tension[i] == 0.0 and s.bend[at3] == 0.0):
                continue
            one = 3 * s.a[i]
            two = 3 * s.b[i]
            sx = sy = sz = 0.0
            if one < n:
                sx = work[ten + one]
                sy = work[ten + one + 1]
                sz = work[ten + one + 2]
            if two < n:
                sx = sx - work[ten + two]
                sy = sy - work[ten + two + 1]
                sz = sz - work[ten + two + 2]
            bent = s.bend[at3] * sx + s.bend[at3 + 1] * sy + s.bend[at3 + 2] * sz
            px = bent * s.way[at3] + side * sx
            py = bent * s.way[at3 + 1] + side * sy
            pz = bent * s.way[at3 + 2] + side * sz
            if one < n:
                work[to * n + one] += px
                work[to * n + one + 1] += py
                work[to * n + one + 2] += pz
            if two < n:
                work[to * n + two] -= px
                work[to * n + two + 1] -= py
                work[to * n + two + 2] -= pz
    times_elements(s, first, last, 10, to)


def _dot(s: Arrays3d, first: int, last: int, one: int, two: int) -> float:
    n = 3 * s.count[0]
    total = 0.0
    for at in range(first, last):
        m = 3 * s.islands[at]
        for c in range(m, m + 3):
            total += s.work[one * n + c] * s.work[two * n + c]
    return total


def correct(s: Arrays3d, first: int, last: int, period: float, inner: float) -> None:
    """Solve Jacobian times row 6 = -row 1 by preconditioned BiCGSTAB (van der Vorst 1992)."""
    n = 3 * s.count[0]
    work = s.work
    for at in range(first, last):
        m = 3 * s.islands[at]
        for c in range(m, m + 3):
            work[4 * n + c] = work[8 * n + c] = work[3 * n + c] = -work[n + c]
            work[6 * n + c] = 0.0
    begun = _dot(s, first, last, 4, 4)
    before = begun
    left = begun
    for _ in range(6 * (last - first) + 8):
        if not left > inner * begun:
            break
        _times(s, first, last, period, 3, 5)
        along = _dot(s, first, last, 8, 5)
        if along == 0.0 or not math.fabs(before) > 0.0:
            break
        step = before / along
        for at in range(first, last):
            m = 3 * s.islands[at]
            for c in range(m, m + 3):
                work[6 * n + c] += step * work[10 * n + c]
                work[4 * n + c] -= step * work[5 * n + c]
        left = _dot(s, first, last, 4, 4)
        if not left > inner * begun:
            break
        _times(s, first, last, period, 4, 9)
        size = _dot(s, first, last, 9, 9)
        if not size > 0.0:
            break
        half = _dot(s, first, last, 9, 4) / size
        for at in range(first, last):
            m = 3 * s.islands[at]
            for c in range(m, m + 3):
                work[6 * n + c] += half * work[10 * n + c]
                work[4 * n + c] -= half * work[9 * n + c]
        left = _dot(s, first, last, 4, 4)
        after = _dot(s, first, last, 8, 4)
        if half == 0.0:
            break
        share = after / before * (step / half)
        before = after
        for at in range(first, last):
            m = 3 * s.islands[at]
            for c in range(m, m + 3):
                old = work[3 * n + c] - half * work[5 * n + c]
                work[3 * n + c] = work[4 * n + c] + share * old


def solve_step3d(
    s: Arrays3d, first: int, last: int, period: float, newton: int
) -> tuple[int, bool]:
    """Find the movement of the masses islands[first:last] without moving them.

    `newton` is the greatest number of iterations; the only one of ONE always counts as converged.

    Returns
    -------
    tuple of int and bool
        Newton's iterations, and whether they converged.
    """
    n = 3 * s.count[0]
    work = s.work
    for at in range(first, last):
        m = s.islands[at]
        base = _base(s, m, period)
        for c in range(3 * m, 3 * m + 3):
            outside = s.weight[c] + s.pushed[c] - s.drag[m] * s.v[c]
            free = period * s.v[c] + outside / base
            work[c] = free
            work[7 * n + c] = free
    worst, scale = residual_of(s, first, last, period)
    inner = _INNER if newton == ONE or s.elements.size[0] == 0 else _ROUGH
    tries = 0
    made = 0  # iteration after which the elements' matrix is made anew
    finished = False
    while tries < newton and not finished and not worst <= _DONE * scale:
        if tries <= made + 1:
            shape_matrix(s, first, last, period)
        tries += 1
        add_diagonal(s, first, last)
        correct(s, first, last, period, inner)
        before = worst
        _move(s, first, last, 1.0)
        worst, scale = residual_of(s, first, last, period)
        if worst < before or newton == ONE:
            finished = inner == _ROUGH and before <= _LAST * scale
            if worst > _POOR * before:
                made = tries
            continue
        back = 1.0
        for _ in range(10):  # overshoot: halve the step until the residual falls
            if before <= _FLOOR * scale:
                break
            back = 0.5 * back
            _move(s, first, last, -back)
            worst, scale = residual_of(s, first, last, period)
            if worst < before:
                break
        if not worst < before:
            _move(s, first, last, -back)
            worst, scale = residual_of(s, first, last, period)
            if tries <= made + 2 or worst <= _FLOOR * scale:
                break
        made = tries
    if newton == ONE:
        return tries, worst < math.inf
    return tries, worst <= _FLOOR * scale


def _move(s: Arrays3d, first: int, last: int, share: float) -> None:
    """Add a share of the correction to the movement; a NaN correction is dropped."""
    n = 3 * s.count[0]
    for at in range(first, last):
        m = 3 * s.islands[at]
        for c in range(m, m + 3):
            change = s.work[6 * n + c]
            if not math.fabs(change) < math.inf:
                s.work[6 * n + c] = change = 0.0
            s.work[c] += share * change


def turn_round(s: Arrays3d, first: int, last: int, period: float) -> None:
    """Keep the masses islands[first:last] in place, which reverses their velocities."""
    for at in range(first, last):
        m = 3 * s.islands[at]
        for c in range(m, m + 3):
            s.work[c] = 0.0
    residual_of(s, first, last, period)


def book_defect(s: Arrays3d, first: int, last: int) -> None:
    """Book the energy that a residual creates: its work in the movement [J]."""
    n = 3 * s.count[0]
    for at in range(first, last):
        m = s.islands[at]
        for c in range(3 * m, 3 * m + 3):
            s.mass_numeric[m] += s.work[n + c] * s.work[c]


def commit_step3d(s: Arrays3d, first: int, last: int, period: float, share: float) -> None:
    """Move the masses islands[first:last] by the solution, and book their links."""
    for at in range(first, last):
        m = s.islands[at]
        for c in range(3 * m, 3 * m + 3):
            moved = s.work[c]
            s.x[c] = s.x[c] + moved
            s.dragged[m] += s.drag[m] * (moved / period) * moved
            s.pumped[m] += s.pushed[c] * moved
            s.v[c] = s.v[c] + 2.0 * (moved - period * s.v[c]) / period
    for at in range(first, last):
        m = s.islands[at]
        for j in range(s.links_first[m], s.links_first[m + 1]):
            i = s.links_of[j]
            if _owned(s, i, m):
                book_link3d(s, i, period, share)
    commit_elements(s, first, last, period)
