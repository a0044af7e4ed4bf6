"""A sampled linear scene at all its ports together, and its loop with devices and hands.

Colgate and Schenkel's condition holds for all axes together if, at every frequency,
2 (1 - cos w T) B - T herm((1 - exp(-j w T)) H) has no negative eigenvalue, with the devices'
damping B on the diagonal: their proof, a sum over aliases, applies axis by axis to B.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.grids import merged
from tautwave.models.linear import flow_rows
from tautwave_scenes.networks.sampled import PortMap

Matrix = npt.NDArray[np.float64]
Modes = tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128]]
"""Eigenvalues, shape (n,), and eigenvectors, shape (n, n)."""


class JointNeed(NamedTuple):
    """Share of the devices' damping that all axes require together, at which frequency [Hz].

    `alone` is the requirement of each axis with the others held [N s/m].
    """

    share: float
    frequency: float
    alone: tuple[float, ...]


def seen(law: PortMap) -> PortMap:
    """Return a map of the states that the axes can feel."""
    acts, near = law.a != 0.0, np.zeros(len(law.a), dtype=bool)
    fresh = np.flatnonzero(np.any(law.c != 0.0, axis=0))
    while len(fresh):
        near[fresh] = True
        fresh = np.flatnonzero(acts[fresh].any(axis=0) & ~near)
    keep = np.flatnonzero(near)
    return law._replace(a=law.a[np.ix_(keep, keep)], b=law.b[keep], c=law.c[:, keep])


def radius_of(law: PortMap) -> float:
    """Return the greatest |z| of the network by itself, its ports held."""
    parts = (law.a[np.ix_(one, one)] for one in apart(law.a))
    return max((float(np.abs(np.linalg.eigvals(part)).max()) for part in parts), default=0.0)


def apart(a: Matrix) -> Iterator[npt.NDArray[np.intp]]:
    """Yield the states of each part of a network that no other part acts on: a net's directions.

    Eigenvalues of three parts cost a ninth of those of the whole.
    """
    linked = (a != 0.0) | (a.T != 0.0)
    left = np.ones(len(a), dtype=bool)
    while left.any():
        part = np.zeros(len(a), dtype=bool)
        fresh = np.flatnonzero(left)[:1]
        while len(fresh):
            part[fresh] = True
            fresh = np.flatnonzero(linked[fresh].any(axis=0) & ~part)
        left &= ~part
        yield np.flatnonzero(part)


def needed_together(law: PortMap, damping: Matrix, delays: Matrix) -> JointNeed:
    """Return how much of the devices' `damping` [N s/m] the held, sampled axes require (searched).

    `delays` [periods] are of each axis' effort.
    """
    axes = len(damping)
    law = seen(law)
    if not len(law.a) and not np.any(law.d):
        return JointNeed(0.0, 0.0, (0.0,) * axes)
    modes = np.linalg.eig(law.a)
    poles = modes.eigenvalues
    grid = [np.geomspace(1e-4, 0.1, 150), np.linspace(0.1, math.pi, 700)]
    if len(poles):
        worst = poles[np.argmax(np.abs(poles))]
        if abs(worst) >= 1.0 - 1e-12:
            hertz = abs(np.angle(worst)) / (2.0 * math.pi * law.period)
            return JointNeed(math.inf, hertz, (math.inf,) * axes)
        for pole in poles[poles.imag > 0.0]:
            width = max(-math.log(abs(pole)), 1e-9)
            grid.append(abs(np.angle(pole)) + width * np.linspace(-20.0, 20.0, 81))
    theta = merged(grid, 1e-6, math.pi)
    leak = leak_together(law, theta, delays, modes)
    alone = tuple(max(float(leak[:, i, i].real.max()), 0.0) for i in range(axes))
    root = np.sqrt(np.maximum(damping, 1e-300))
    shares = np.linalg.eigvalsh(leak / np.outer(root, root))[:, -1]
    at = int(np.argmax(shares))
    hertz = float(theta[at]) / (2.0 * math.pi * law.period)
    return JointNeed(max(float(shares[at]), 0.0), hertz, alone)


def leak_together(
    law: PortMap, theta: Matrix, delays: Matrix, modes: Modes | None = None
) -> npt.NDArray[np.complex128]:
    """Return the damping that all axes together require at angles w T: a Hermitian matrix each.

    `modes` of `law.a`, where they are known.
    """
    answers = responses(law, np.exp(1j * theta), modes)
    late = np.exp(-1j * np.outer(theta, delays))[:, :, None] * answers
    part = 0.5 * law.period * (1.0 + 1j / np.tan(0.5 * theta))[:, None, None] * late
    return np.asarray(0.5 * (part + np.conj(np.swapaxes(part, 1, 2))), np.complex128)


def responses(
    law: PortMap, z: npt.NDArray[np.complex128], modes: Modes | None = None
) -> npt.NDArray[np.complex128]:
    """Return efforts over positions at points z, by modes where these are well apart."""
    few = min(len(z), 3)
    exact = np.array([_response(law, one) for one in z[:: max(len(z) // few, 1)]])
    poles, shapes = modes or np.linalg.eig(law.a)
    try:
        given = np.linalg.solve(shapes, law.b.astype(np.complex128))
    except np.linalg.LinAlgError:
        given = np.full(law.b.shape, math.nan + 0j)
    shares = (law.c @ shapes).T[:, :, None] * given[:, None, :]

    def by_modes(at: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
        sums = np.tensordot(1.0 / (at[:, None] - poles), shares, 1) + law.d
        return np.asarray(sums, np.complex128)

    close = by_modes(z[:: max(len(z) // few, 1)])
    if np.abs(close - exact).max() <= 1e-9 * np.abs(exact).max():
        return by_modes(z)
    return np.array([_response(law, one) for one in z]).reshape(-1, *law.d.shape)


def _response(law: PortMap, z: complex) -> npt.NDArray[np.complex128]:
    if not len(law.a):
        return np.asarray(law.d, np.complex128)
    states = np.linalg.solve(z * np.eye(len(law.a)) - law.a, law.b.astype(np.complex128))
    return np.asarray(law.c @ states + law.d, np.complex128)


def joint_poles(
    law: PortMap,
    masses: Matrix,
    dampings: Matrix,
    stiffnesses: Matrix,
    delays: list[int],
) -> npt.NDArray[np.complex128]:
    """Return the poles in z of the network with all devices held, each effort with its delay."""
    law = seen(law)
    n, axes = len(law.a), len(masses)
    size = 2 * axes + n + sum(delays)
    whole = np.zeros((size, size))
    effort = np.zeros((axes, size))
    effort[:, : 2 * axes : 2] = law.d
    effort[:, 2 * axes : 2 * axes + n] = law.c
    inner = slice(2 * axes, 2 * axes + n)
    whole[inner, : 2 * axes : 2], whole[inner, inner] = law.b, law.a
    line = 2 * axes + n
    for i in range(axes):
        k, z = float(stiffnesses[i]), float(dampings[i])
        xv, xn, _, vv, vn, _ = flow_rows(k, z, float(masses[i]), law.period)[:6]
        at = 2 * i
        whole[at : at + 2, at : at + 2] = [
            [1.0 - k * xn, xv - z * xn],
            [-k * vn, 1.0 + vv - z * vn],
        ]
        push = np.array([-xn, -vn])
        if delays[i] == 0:
            whole[at : at + 2] += np.outer(push, effort[i])
            continue
        whole[line] = effort[i]
        for step in range(1, delays[i]):
            whole[line + step, line + step - 1] = 1.0
        line += delays[i]
        whole[at : at + 2, line - 1] += push
    return np.asarray(np.linalg.eigvals(whole), np.complex128)
