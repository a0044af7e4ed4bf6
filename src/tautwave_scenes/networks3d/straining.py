"""Elements of tissue in a discrete-gradient step: their pulls, their matrix, their books.

The laws are in `models.tissue.element`; rows of `work` are those of `networks3d.solving`.
The matrix is the derivative of the mean pull, of which the rotation's part belongs to the elastic
stress alone. Plain Python on lists, or compiled by numba.
"""

from __future__ import annotations

from tautwave_scenes.models.tissue.algebra import (
    Matrix,
    Symmetric,
    Vector,
    full,
    inverse,
    product,
    rotation_of,
    squared_up,
    stretch_of,
    transposed,
    turning,
)
from tautwave_scenes.models.tissue.element import mean_pull, strain_energy, stress
from tautwave_scenes.networks3d.arrays import Arrays3d

ROUNDING = 1.0
"""Rounding of an element's force, in units of its force at a strain of 1."""


def matrix_at(values: list[float], e: int) -> Matrix:
    """Return nine numbers of element e."""
    i = 9 * e
    return (
        values[i],
        values[i + 1],
        values[i + 2],
        values[i + 3],
        values[i + 4],
        values[i + 5],
        values[i + 6],
        values[i + 7],
        values[i + 8],
    )


def symmetric_at(values: list[float], e: int) -> Symmetric:
    """Return six numbers of element e."""
    i = 6 * e
    return (
        values[i],
        values[i + 1],
        values[i + 2],
        values[i + 3],
        values[i + 4],
        values[i + 5],
    )


def _place(s: Arrays3d, node: int, share: float) -> Vector:
    at = 3 * node
    if node < s.count[0] and share > 0.0:
        return (s.x[at] + s.work[at], s.x[at + 1] + s.work[at + 1], s.x[at + 2] + s.work[at + 2])
    return (s.x[at], s.x[at + 1], s.x[at + 2])


def deformation(s: Arrays3d, e: int, share: float) -> Matrix:
    """Return the deformation gradient of an element, at the end of the step if `share` > 0."""
    t = s.elements
    o = _place(s, t.corner[4 * e], share)
    p = _place(s, t.corner[4 * e + 1], share)
    q = _place(s, t.corner[4 * e + 2], share)
    r = _place(s, t.corner[4 * e + 3], share)
    edges = (
        p[0] - o[0],
        q[0] - o[0],
        r[0] - o[0],
        p[1] - o[1],
        q[1] - o[1],
        r[1] - o[1],
        p[2] - o[2],
        q[2] - o[2],
        r[2] - o[2],
    )
    return product(edges, matrix_at(t.grad, e))


def _added(a: Symmetric, k: float, b: Symmetric) -> Symmetric:
    return (
        a[0] + k * b[0],
        a[1] + k * b[1],
        a[2] + k * b[2],
        a[3] + k * b[3],
        a[4] + k * b[4],
        a[5] + k * b[5],
    )


def branch_mean(s: Arrays3d, e: int, j: int, change: Symmetric, period: float) -> Symmetric:
    """Return the mean elastic strain of a branch while its element is strained by `change`."""
    t = s.elements
    at = e * t.size[1] + j
    ease = 1.0 / (1.0 + 0.5 * period / t.relax[at])
    mean = _added(symmetric_at(t.held, at), 0.5, change)
    return (
        ease * mean[0],
        ease * mean[1],
        ease * mean[2],
        ease * mean[3],
        ease * mean[4],
        ease * mean[5],
    )


def pull_elements(s: Arrays3d, first: int, last: int, period: float) -> float:
    """Add the elements' forces to the residual of islands[first:last]; return the force scale."""
    t = s.elements
    n = 3 * s.count[0]
    scale = 0.0
    if t.size[0] == 0:
        return scale
    for at in range(first, last):
        m = s.islands[at]
        for e in range(t.owned[m], t.owned[m + 1]):
            f = deformation(s, e, 0.0)
            f_new = deformation(s, e, 1.0)
            r_new = rotation_of(f_new, matrix_at(t.next_turn, e))
            u_new = stretch_of(r_new, f_new)
            e_new = (u_new[0] - 1.0, u_new[1] - 1.0, u_new[2] - 1.0, u_new[3], u_new[4], u_new[5])
            for c in range(9):
                t.next_turn[9 * e + c] = r_new[c]
            for c in range(6):
                t.next_strain[6 * e + c] = e_new[c]
            before = symmetric_at(t.strain, e)
            change = _added(e_new, -1.0, before)
            mean = _added(before, 0.5 + t.viscous[e] / period, change)
            for j in range(t.size[1]):
                share = t.share[e * t.size[1] + j]
                mean = _added(mean, share, branch_mean(s, e, j, change, period))
            pull = stress(t.mu[e], t.lam[e], mean)
            p = mean_pull(f, f_new, matrix_at(t.turn, e), r_new, before, e_new, pull)
            size = t.volume[e]
            if ROUNDING * t.stiff[e] > scale:
                scale = ROUNDING * t.stiff[e]
            total = (0.0, 0.0, 0.0)
            for k in range(1, 4):
                g = 9 * e + 3 * (k - 1)
                gx, gy, gz = t.grad[g], t.grad[g + 1], t.grad[g + 2]
                fx = size * (p[0] * gx + p[1] * gy + p[2] * gz)
                fy = size * (p[3] * gx + p[4] * gy + p[5] * gz)
                fz = size * (p[6] * gx + p[7] * gy + p[8] * gz)
                total = (total[0] + fx, total[1] + fy, total[2] + fz)
                _add_force(s, n, t.corner[4 * e + k], fx, fy, fz)
            _add_force(s, n, t.corner[4 * e], -total[0], -total[1], -total[2])
    return scale


def _add_force(s: Arrays3d, n: int, node: int, fx: float, fy: float, fz: float) -> None:
    at = 3 * node
    if at < n:
        s.work[n + at] += fx
        s.work[n + at + 1] += fy
        s.work[n + at + 2] += fz


def _cross_of(h: Vector) -> Matrix:
    return (0.0, -h[2], h[1], h[2], 0.0, -h[0], -h[1], h[0], 0.0)


def _turned(r: Matrix, gx: float, gy: float, gz: float) -> Vector:
    return (
        r[0] * gx + r[1] * gy + r[2] * gz,
        r[3] * gx + r[4] * gy + r[5] * gz,
        r[6] * gx + r[7] * gy + r[8] * gz,
    )


def element_matrix(s: Arrays3d, e: int, kappa: float, bend: float) -> None:
    """Add to the blocks of the matrix V (kappa C + bend times the rotation's part) of an element.

    Of the strain and rotation at the end of the step; the derivative of the force at a fixed place
    is that of `kappa` = `bend` = 1.
    """
    t = s.elements
    r = matrix_at(t.next_turn, e)
    strain = symmetric_at(t.next_strain, e)
    mu = t.mu[e]
    lam = t.lam[e]
    u = (1.0 + strain[0], 1.0 + strain[1], 1.0 + strain[2], strain[3], strain[4], strain[5])
    soft, size = inverse(turning(u))
    q = (mu, 0.0, 0.0, 0.0, mu, 0.0, 0.0, 0.0, mu)
    if size > 0.0:
        c = lam * (strain[0] + strain[1] + strain[2]) - 2.0 * mu
        k = (c * soft[0], c * soft[1], c * soft[2], c * soft[3], c * soft[4], c * soft[5])
        q = full((mu + k[0], mu + k[1], mu + k[2], k[3], k[4], k[5]))
    q = product(r, product(q, transposed(r)))
    g = 9 * e
    one = _turned(r, t.grad[g], t.grad[g + 1], t.grad[g + 2])
    two = _turned(r, t.grad[g + 3], t.grad[g + 4], t.grad[g + 5])
    three = _turned(r, t.grad[g + 6], t.grad[g + 7], t.grad[g + 8])
    zero = (
        -(one[0] + two[0] + three[0]),
        -(one[1] + two[1] + three[1]),
        -(one[2] + two[2] + three[2]),
    )
    h = (zero, one, two, three)
    stiff = kappa * t.volume[e]
    turn = bend * t.volume[e]
    for b in range(4):
        hb = h[b]
        bent = product(q, _cross_of(hb))
        for a in range(4):
            at = t.place[16 * e + 4 * a + b]
            if at < 0:
                continue
            ha = h[a]
            part = product(transposed(_cross_of(ha)), bent)
            along = mu * (ha[0] * hb[0] + ha[1] * hb[1] + ha[2] * hb[2])
            for i in range(3):
                for j in range(3):
                    entry = lam * ha[i] * hb[j] + mu * hb[i] * ha[j]
                    if i == j:
                        entry = entry + along
                    t.tangent[9 * at + 3 * i + j] += stiff * entry + turn * part[3 * i + j]


def shape_matrix(s: Arrays3d, first: int, last: int, period: float) -> None:
    """Fill the matrix of the elements of islands[first:last] at the movement."""
    t = s.elements
    if t.size[0] == 0:
        return
    for at in range(first, last):
        m = s.islands[at]
        for c in range(9 * t.row[m], 9 * t.row[m + 1]):
            t.tangent[c] = 0.0
    for at in range(first, last):
        m = s.islands[at]
        for e in range(t.owned[m], t.owned[m + 1]):
            kappa = 0.5 + t.viscous[e] / period
            for j in range(t.size[1]):
                b = e * t.size[1] + j
                kappa = kappa + 0.5 * t.share[b] / (1.0 + 0.5 * period / t.relax[b])
            element_matrix(s, e, kappa, 0.5)


def add_diagonal(s: Arrays3d, first: int, last: int) -> None:
    """Add the diagonal of the elements' matrix to the preconditioner, row 2."""
    t = s.elements
    n = 3 * s.count[0]
    if t.size[0] == 0:
        return
    for at in range(first, last):
        m = s.islands[at]
        for c in range(3):
            own = t.tangent[9 * t.row[m] + 4 * c]
            if own > 0.0:
                s.work[2 * n + 3 * m + c] += own


def times_elements(s: Arrays3d, first: int, last: int, given: int, to: int) -> None:
    """Add the elements' matrix times row `given` to row `to`."""
    t = s.elements
    n = 3 * s.count[0]
    if t.size[0] == 0:
        return
    for at in range(first, last):
        m = s.islands[at]
        x = y = z = 0.0
        for j in range(t.row[m], t.row[m + 1]):
            k = 9 * j
            other = given * n + 3 * t.column[j]
            gx = s.work[other]
            gy = s.work[other + 1]
            gz = s.work[other + 2]
            x += t.tangent[k] * gx + t.tangent[k + 1] * gy + t.tangent[k + 2] * gz
            y += t.tangent[k + 3] * gx + t.tangent[k + 4] * gy + t.tangent[k + 5] * gz
            z += t.tangent[k + 6] * gx + t.tangent[k + 7] * gy + t.tangent[k + 8] * gz
        s.work[to * n + 3 * m] += x
        s.work[to * n + 3 * m + 1] += y
        s.work[to * n + 3 * m + 2] += z


def commit_elements(s: Arrays3d, first: int, last: int, period: float) -> None:
    """Take the strains at the movement for the present ones, and book them [J]."""
    t = s.elements
    if t.size[0] == 0:
        return
    for at in range(first, last):
        m = s.islands[at]
        for e in range(t.owned[m], t.owned[m + 1]):
            r = squared_up(matrix_at(t.next_turn, e))
            after = symmetric_at(t.next_strain, e)
            change = _added(after, -1.0, symmetric_at(t.strain, e))
            mu = t.mu[e]
            lam = t.lam[e]
            kept = strain_energy(mu, lam, after)
            dissipated = 2.0 * t.viscous[e] / period * strain_energy(mu, lam, change)
            for j in range(t.size[1]):
                b = e * t.size[1] + j
                mean = branch_mean(s, e, j, change, period)
                held = symmetric_at(t.held, b)
                for c in range(6):
                    t.held[6 * b + c] = 2.0 * mean[c] - held[c]
                kept += t.share[b] * strain_energy(mu, lam, symmetric_at(t.held, b))
                lost = 2.0 * period / t.relax[b] * strain_energy(mu, lam, mean)
                dissipated += t.share[b] * lost
            t.kept[e] = t.volume[e] * kept
            t.dissipated[e] += t.volume[e] * dissipated
            for c in range(9):
                t.turn[9 * e + c] = t.next_turn[9 * e + c] = r[c]
            for c in range(6):
                t.strain[6 * e + c] = after[c]


def strain_energies(s: Arrays3d) -> tuple[float, float]:
    """Return what all elements hold and have dissipated [J]."""
    kept = 0.0
    dissipated = 0.0
    for e in range(s.elements.size[0]):
        kept += s.elements.kept[e]
        dissipated += s.elements.dissipated[e]
    return kept, dissipated
