"""Linear networks without any error of discretisation: each island by its matrix exponential.

A port is held over a step (its position for springs, its speed for dampers), as are external forces
and weight; between samples the motion is exact, so frequencies and decays are those of the
continuous network at any rate. The energy lost in a step is a quadratic form of state and input,
exact as well. Its force on a port is that of the links at the sample: the paper's one-sample
structure ("zoh" of `analysis.resonator_sampled`).

With u held, x' = A x + B u is one matrix A over (x, u): exp(A T) - 1 by Taylor series of a short
step and doubling, in increments, so that slow modes keep their digits. The loss
W = integral of exp(A't) C exp(At) doubles as W + M'W M.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError
from tautwave_scenes.models.interaction import SPRING
from tautwave_scenes.networks.compiling import Arrays

Matrix = npt.NDArray[np.float64]

_SHORT = 0.25
_TERMS = 24
MOST = 400
"""Most masses of one island; a larger dense matrix is slower than any other scheme."""


class Island(NamedTuple):
    """One connected part: its masses, ports and links, and its maps as lists of rows.

    The state is (x of the masses, v of the masses), the input (position of each port, speed of each
    port, external force on each mass, 1). `change` (2n, 2n + u) gives the increment of the state,
    `loss` (2n + u, 2n + u) the energy lost.
    """

    masses: tuple[int, ...]
    ports: tuple[int, ...]
    links: tuple[int, ...]
    change: list[list[float]]
    loss: list[list[float]]


def linear_matrices(s: Arrays, masses: Sequence[int]) -> tuple[Matrix, Matrix, Matrix]:
    """Return mass, damping and stiffness matrix of some masses, everything else held still."""
    index = {mass: at for at, mass in enumerate(masses)}
    size = len(masses)
    inertia = np.diag([float(s.mass[m]) for m in masses])
    damping = np.diag([float(s.drag[m]) for m in masses]).reshape(size, size)
    stiffness = np.zeros((size, size))
    for i in range(s.count[2]):
        if s.kind[i] != SPRING:
            continue
        ends = [index[end] for end in (s.a[i], s.b[i]) if end in index]
        for row in ends:
            for column in ends:
                sign = 1.0 if row == column else -1.0
                stiffness[row, column] += sign * s.k[i]
                damping[row, column] += sign * s.z[i]
    return inertia, damping, stiffness


def exact_islands(s: Arrays, period: float) -> tuple[Island, ...]:
    """Return the exact maps of every island of a linear network.

    Raises
    ------
    ConfigError
        A link is not linear, or an island has more than `MOST` masses.
    """
    if any(kind != SPRING for kind in s.kind):
        raise ConfigError("scheme exact: only springs and dampers; use discrete_gradient")
    groups = [(mass,) for mass in s.alone]
    groups += [
        tuple(s.islands[first:last])
        for first, last in zip(s.island_first[:-1], s.island_first[1:], strict=True)
    ]
    if max(map(len, groups), default=0) > MOST:
        raise ConfigError(
            f"scheme exact: at most {MOST} masses may be connected; use discrete_gradient"
        )
    return tuple(_island(s, masses, period) for masses in groups)


def _island(s: Arrays, masses: tuple[int, ...], period: float) -> Island:
    a, c, ports, links = island_flow(s, masses)
    n = len(masses)
    change, loss = flow_maps(a, c, period)
    return Island(masses, ports, links, change[: 2 * n].tolist(), loss.tolist())


def island_flow(
    s: Arrays, masses: Sequence[int]
) -> tuple[Matrix, Matrix, tuple[int, ...], tuple[int, ...]]:
    """Return A over (state, input), the loss form C, and the ports and links of an island."""
    index = {mass: at for at, mass in enumerate(masses)}
    n = len(masses)
    links = tuple(i for i in range(s.count[2]) if s.a[i] in index or s.b[i] in index)
    first_ground = s.count[0] + s.count[1]
    ports = tuple(
        dict.fromkeys(
            end for i in links for end in (s.a[i], s.b[i]) if s.count[0] <= end < first_ground
        )
    )
    p = len(ports)
    size = 2 * n + 2 * p + n + 1
    one = size - 1
    a = np.zeros((size, size))
    c = np.zeros((size, size))
    for at, mass in enumerate(masses):
        a[at, n + at] = 1.0
        a[n + at, 2 * n + 2 * p + at] += 1.0
        a[n + at, one] += s.weight[mass]
        a[n + at, n + at] -= s.drag[mass]
        c[n + at, n + at] += s.drag[mass]
    for i in links:
        stretch, rate = np.zeros(size), np.zeros(size)
        for end, sign in ((s.a[i], 1.0), (s.b[i], -1.0)):
            if end in index:
                stretch[index[end]] += sign
                rate[n + index[end]] += sign
            elif end in ports:
                stretch[2 * n + ports.index(end)] += sign
                rate[2 * n + p + ports.index(end)] += sign
            else:
                stretch[one] += sign * s.x[end]
        stretch[one] -= s.rest[i]
        pull = s.k[i] * stretch + s.z[i] * rate
        for end, sign in ((s.a[i], -1.0), (s.b[i], 1.0)):
            if end in index:
                a[n + index[end]] += sign * pull
        c += s.z[i] * np.outer(rate, rate)
    for at, mass in enumerate(masses):
        a[n + at] /= s.mass[mass]
    return a, c, ports, links


def flow_maps(a: Matrix, c: Matrix, period: float) -> tuple[Matrix, Matrix]:
    """Return exp(a T) - 1 and the integral of exp(a' t) c exp(a t) over T."""
    norm = _size(a) * period
    count = 0 if norm <= _SHORT else int(np.ceil(np.log2(norm / _SHORT)))
    h = period / 2.0**count
    term = np.eye(len(a))
    change = np.zeros_like(a)
    for i in range(1, _TERMS):
        term = term @ a * (h / i)
        change = change + term
    form = c * h
    loss = form.copy()
    for i in range(2, _TERMS):
        form = (a.T @ form + form @ a) * (h / i)
        loss = loss + form
    for _ in range(count):
        whole = change + np.eye(len(a))
        loss = loss + whole.T @ loss @ whole
        change = 2.0 * change + change @ change
    return change, 0.5 * (loss + loss.T)


def _size(a: Matrix) -> float:
    """Return a bound of the rates in A, balanced between positions and velocities."""
    size = float(np.sqrt(np.abs(a @ a).sum(axis=1).max()))
    return max(size, float(np.abs(np.diag(a)).max()))


def step_exact(s: Arrays, islands: Sequence[Island], period: float) -> None:
    """Advance all masses by one step [s]; ports were put in place by `tension.jump_ports`.

    `force` then holds the forces of the links at the sample, before the step.
    """
    masses = s.count[0]
    for i in range(masses + s.count[1]):
        s.force[i] = 0.0
    for i in range(s.count[2]):
        one, two = s.a[i], s.b[i]
        pull = s.k[i] * (s.x[one] - s.x[two] - s.rest[i]) + s.z[i] * (s.v[one] - s.v[two])
        s.tension[i] = pull
        s.force[one] -= pull
        s.force[two] += pull
    for island in islands:
        _step_island(s, island, period)


def _step_island(s: Arrays, island: Island, period: float) -> None:
    n = len(island.masses)
    state: list[Any] = [s.x[m] for m in island.masses] + [s.v[m] for m in island.masses]
    state += [s.x[at] for at in island.ports] + [s.v[at] for at in island.ports]
    state += [s.pushed[m] for m in island.masses] + [1.0]
    lost = 0.0
    for row, left in zip(island.loss, state, strict=True):
        total = 0.0
        for factor, right in zip(row, state, strict=True):
            total += factor * right
        lost += left * total
    start = state[:n]
    for at, row in enumerate(island.change):
        total = 0.0
        for factor, right in zip(row, state, strict=True):
            total += factor * right
        mass = island.masses[at % n]
        if at < n:
            s.x[mass] += total
            s.pumped[mass] += s.pushed[mass] * total
        else:
            s.v[mass] += total
    s.dragged[island.masses[0]] += lost
    moved = {m: s.x[m] - was for m, was in zip(island.masses, start, strict=True)}
    for i in island.links:
        if s.k[i] > 0.0:
            d = s.x[s.a[i]] - s.x[s.b[i]] - s.rest[i]
            s.stored[i] = 0.5 * s.k[i] * d * d
        if s.z[i] > 0.0:
            _book_ports(s, i, moved, period)


def _book_ports(s: Arrays, i: int, moved: dict[int, float], period: float) -> None:
    """Book the work of ports at a damper: its mean tension times their displacement."""
    masses, ports = s.count[0], s.count[0] + s.count[1]
    one, two = s.a[i], s.b[i]
    swept = moved.get(one, 0.0) - moved.get(two, 0.0)
    swept += period * (s.v[one] if one >= masses else 0.0)
    swept -= period * (s.v[two] if two >= masses else 0.0)
    for end, sign in ((one, 1.0), (two, -1.0)):
        if masses <= end < ports:
            s.port_work[end - masses] += sign * s.z[i] * swept * s.v[end]
