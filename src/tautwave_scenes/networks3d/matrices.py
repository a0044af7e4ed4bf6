"""Mass, damping and stiffness matrices of a 3D network's linear part, near its present position.

A spring of stiffness k, stretched to the length r with the tension t, has the stiffness k along its
line and t/r across it: less than k while it is not compressed, whatever its direction. A damper
acts along its line. Power laws, contacts, plastic links and friction are not included.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave_scenes.models.interaction import SPRING
from tautwave_scenes.models.link_kinds import BY_NUMBER, Constants
from tautwave_scenes.networks3d.arrays import Arrays3d
from tautwave_scenes.networks3d.straining import element_matrix
from tautwave_scenes.networks3d.tension import length_of, link_way

Matrix = npt.NDArray[np.float64]


class Tangent(NamedTuple):
    """Over the coordinates of masses and ports, 3 (n + p): `damping`, `stiffness`; `mass` (3 n).

    `ways` (3 p, q) maps positions of the axes to those of the ports. `branches` are times [s] and
    stiffnesses (3 n, 3 n) of the parts of tissues that relax; `stiffness` is without them.
    """

    mass: Matrix
    damping: Matrix
    stiffness: Matrix
    ways: Matrix
    branches: tuple[tuple[float, Matrix], ...] = ()


def tangent(s: Arrays3d) -> Tangent:
    """Return the matrices at the present positions."""
    nodes = s.count[0] + s.count[1]
    damping = np.zeros((3 * nodes, 3 * nodes))
    stiffness = np.zeros_like(damping)
    for m in range(s.count[0]):
        for c in range(3 * m, 3 * m + 3):
            damping[c, c] = s.drag[m]
    for i in range(s.count[2]):
        if s.kind[i] != SPRING:
            continue
        r = length_of(s, i)
        along = np.outer(link_way(s, i), link_way(s, i))
        # Without a rest length the direction is irrelevant, even at zero length.
        across = s.k[i] if s.rest[i] == 0.0 else s.k[i] * (r - s.rest[i]) / r if r > 0.0 else 0.0
        of_link = (s.k[i] - across) * along + across * np.eye(3)
        for row, one in ((s.a[i], 1.0), (s.b[i], -1.0)):
            for column, two in ((s.a[i], 1.0), (s.b[i], -1.0)):
                if row < nodes and column < nodes:
                    at = np.ix_(range(3 * row, 3 * row + 3), range(3 * column, 3 * column + 3))
                    stiffness[at] += one * two * of_link
                    damping[at] += one * two * s.z[i] * along
    own = 3 * s.count[0]
    elements = range(s.elements.size[0])
    stiffness[:own, :own] += _of_elements(s, dict.fromkeys(elements, (1.0, 1.0)))
    damping[:own, :own] += _of_elements(s, {e: (s.elements.viscous[e], 0.0) for e in elements})
    ways = np.zeros((3 * s.count[1], s.count[3]))
    for axis in range(s.count[3]):
        for c in range(3):
            ways[3 * s.axis_port[axis] + c, axis] = s.axis_way[3 * axis + c]
    masses = np.repeat(np.asarray(s.mass, np.float64), 3)
    return Tangent(masses, damping, stiffness, ways, tuple(_relaxing(s)))


def _relaxing(s: Arrays3d) -> Iterator[tuple[float, Matrix]]:
    """Yield each time in which parts of tissues relax, and their stiffness."""
    by_time: dict[float, dict[int, tuple[float, float]]] = {}
    for e in range(s.elements.size[0]):
        for j in range(e * s.elements.size[1], (e + 1) * s.elements.size[1]):
            if s.elements.share[j] > 0.0:
                of_time = by_time.setdefault(s.elements.relax[j], {})
                of_time[e] = (of_time.get(e, (0.0, 0.0))[0] + s.elements.share[j], 0.0)
    for time, shares in by_time.items():
        yield time, _of_elements(s, shares)


def _of_elements(s: Arrays3d, factors: Mapping[int, tuple[float, float]]) -> Matrix:
    """Return the sum of elements' matrices (3 n, 3 n); see `element_matrix` for the factors."""
    t, n = s.elements, s.count[0]
    whole = np.zeros((3 * n, 3 * n))
    if not factors:
        return whole
    for at in range(len(t.tangent)):
        t.tangent[at] = 0.0
    for e, (kappa, bend) in factors.items():
        element_matrix(s, e, kappa, bend)
    for m in range(n):
        for j in range(t.row[m], t.row[m + 1]):
            other = t.column[j]
            block = np.array(t.tangent[9 * j : 9 * j + 9]).reshape(3, 3)
            whole[3 * m : 3 * m + 3, 3 * other : 3 * other + 3] = block
    return whole


def symplectic_share(s: Arrays3d, period: float) -> float:
    """Return the share of the symplectic scheme's stability limit used in the worst posture.

    That is k T**2/m + 2 z T/m over 4, for all links at once (`steepest`), with contacts closed,
    links sliding and in parallel: no posture is stiffer. Nonlinear springs and nonlinear contacts
    with a plane have no greatest stiffness and are left out.
    """
    count = s.count[0]
    whole = np.zeros((count, count))
    for m in range(count):
        whole[m, m] = 2.0 * period * s.drag[m]
    for i in range(s.count[2]):
        k, z = steepest(s, i)
        size = period * (period * k + 2.0 * z)
        ends = [end for end in (s.a[i], s.b[i]) if end < count]
        for row in ends:
            for column in ends:
                whole[row, column] += size if row == column else -size
    if not count:
        return 0.0
    root = np.array([math.sqrt(mass) for mass in s.mass])
    whole /= np.outer(root, root)
    if count > MOST:  # Gershgorin
        return float(np.abs(whole).sum(axis=1).max()) / 4.0
    return float(np.linalg.eigvalsh(whole).max()) / 4.0


def steepest(s: Arrays3d, i: int) -> tuple[float, float]:
    """Return the greatest stiffness [N/m] and damping [N s/m] of a link, if they exist.

    Two balls overlap at most by their radii; friction is steepest at rest.
    """
    depth = math.inf if s.flat[i] else s.rest[i]
    constants = Constants(s.k[i], s.e[i], s.z[i], s.loss[i], s.limit[i], s.scale[i], depth)
    return BY_NUMBER[s.kind[i]].steepest(constants)


MOST = 400
"""Masses up to which eigenvalues are computed; above, the sum of a row is taken."""
