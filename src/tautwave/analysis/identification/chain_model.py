"""Masses of a whole chain from one recording of its motion and of its motors' efforts.

The base parameters (`chain_regressor`) are found by least squares beside friction, offsets and the
motors' own inertia; of what the motion does not tell, the belief decides. Then bodies that can
exist are sought that say the same: each has a pseudo-inertia that is positive definite, by its
logarithmic Cholesky factors (Rucker and Wensing, 2022), as near to the belief as the efforts allow.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.chain_regressor import (
    PARAMETERS,
    Base,
    base_of,
    efforts_by_body,
    parameters_of,
)
from tautwave.analysis.identification.regression import Z_95, Array, Estimate, Kernel
from tautwave.models.chain.params import ChainParams

SHARPER = 4.0
"""The motion is smoothed this much less than what is fitted, so that both sides of an equation
that is not linear in it pass the same filter."""
SLOW_SHARE = 0.02
"""Of a joint's greatest velocity, below which its friction has no known sign."""
MIN_ROWS = 60
STRETCH = 40
"""Rows of a stretch whose scatter gives the intervals, and how many there are at least."""
MIN_STRETCHES = 20
CORRELATED = 3.5
"""Neighbouring rows that say as much as one: the sum of a filtered residual's correlation."""
MASS, REACH = 0.5, 0.1
"""A belief is wrong by half of its mass, or of 1 kg without one, and by 0.1 m of its centre."""
SAME = 1e-6
"""Share of a column that others must leave of it, for the motor's inertia to be fitted as well."""
TOLD = 0.5
"""Share of what a belief may be wrong by that is left of it, where a motion tells a parameter."""
STEPS = 60
THICK = 0.01
"""[m] Radius of gyration below which a body that is believed is made no thinner."""


class FoundBody(NamedTuple):
    """A body that can exist, in its joint's frame: mass [kg], centre [m], and all parameters."""

    mass: Estimate
    centre: tuple[Estimate, Estimate, Estimate]
    parameters: Array


class ChainFit(NamedTuple):
    """Base parameters with 95 % intervals, and bodies that say the same.

    `told` says of each base parameter whether the motion told it; `believed` are those of the
    belief. `friction` has by joint Coulomb and viscous friction and the offset of its effort.
    `residual` [N m or N] by joint is what base parameters leave, `bodies_residual` what bodies that
    can exist leave; `explained` is the least share of a joint's efforts that is explained.
    """

    base: Base
    found: tuple[Estimate, ...]
    told: tuple[bool, ...]
    believed: Array
    friction: tuple[tuple[Estimate, Estimate, Estimate], ...]
    bodies: tuple[FoundBody, ...]
    residual: tuple[float, ...]
    bodies_residual: tuple[float, ...]
    explained: float


class _Rows(NamedTuple):
    """Equations of all joints, one after the other, filtered: `ends` is where each joint begins."""

    base: Array
    own: Array
    target: Array
    ends: NDArray[np.int64]


def fit_chain(
    chain: ChainParams,
    positions: Sequence[Array],
    efforts: Sequence[Array],
    period: float,
    *,
    cutoff_hz: float,
    delay: float = 0.0,
    known: NDArray[np.bool_],
) -> ChainFit:
    """Fit a chain that moved freely under its motors.

    Parameters
    ----------
    chain : ChainParams
        Geometry, gravity, and the bodies that are believed; without masses little is believed.
    positions, efforts : sequence of array, (n,)
        By joint, one sample a period [rad or m, N m or N]; an effort is held for a period.
    period : float
        [s].
    cutoff_hz : float
        Of the filter on both sides of the equations.
    delay : float
        Periods until an effort acts; below 0: it was measured, with the positions.
    known : array of bool, (n,)
        Samples that were measured; the others are filled in, and not used.

    Raises
    ------
    ValueError
        It is too short, or a joint hardly moved.
    """
    base, believed = base_of(chain), _bodies_believed(chain)
    rows = _rows(chain, base, positions, efforts, period, cutoff_hz, delay, known)
    trust = np.array([_doubt(one) for one in believed]).ravel()
    spans = np.sqrt(np.square(base.share) @ np.square(trust))
    start = base.of(np.concatenate(believed))
    count = base.share.shape[0]
    columns = np.hstack([rows.base * spans, rows.own])
    target = rows.target - rows.base @ start
    prior = np.zeros(columns.shape[1])
    prior[:count] = 1.0
    noises = np.ones(len(target))
    for _ in range(3):  # each joint's residual says how much its equations count
        values = _solved(columns / noises[:, None], target / noises, prior)
        left = _by_joint(target - columns @ values, rows.ends)
        least = max(1e-3 * max(left), 1e-12)
        sizes = [max(one, least) for one in left]
        noises = np.repeat(sizes, np.diff([*rows.ends, len(target)]))
    halves = _halves(columns / noises[:, None], (target - columns @ values) / noises, prior)
    base_values = start + spans * values[:count]
    estimates = _estimates(base_values, spans * halves[:count])
    told = tuple(bool(half < TOLD * Z_95) for half in halves[:count])
    own = _estimates(values[count:], halves[count:])
    joints = len(chain.joints)
    friction = tuple((own[3 * j], own[3 * j + 1], own[3 * j + 2]) for j in range(joints))
    bodies, kept = _plausible(rows, base, believed, noises)
    rest = rows.target - rows.base @ base.of(kept)
    free = rest - rows.own @ _solved(
        rows.own / noises[:, None], rest / noises, np.zeros(rows.own.shape[1])
    )
    spread = _by_joint(rows.target - np.mean(rows.target), rows.ends)
    return ChainFit(
        base,
        estimates,
        told,
        start,
        friction,
        bodies,
        tuple(left),
        tuple(_by_joint(free, rows.ends)),
        min(1.0 - (one / max(all_, 1e-300)) ** 2 for one, all_ in zip(left, spread, strict=True)),
    )


def _rows(
    chain: ChainParams,
    base: Base,
    positions: Sequence[Array],
    efforts: Sequence[Array],
    period: float,
    cutoff_hz: float,
    delay: float,
    known: NDArray[np.bool_],
) -> _Rows:
    kernel, sharp = Kernel(period, cutoff_hz), Kernel(period, SHARPER * cutoff_hz)
    if len(known) <= 2 * (kernel.half + sharp.half) + MIN_ROWS * kernel.step:
        raise ValueError("the recording is too short; move the arm for longer")
    q, v, a = (
        np.stack([sharp.apply(one, order) for one in positions], axis=1) for order in (0, 1, 2)
    )
    good = (kernel.mass(sharp.mass(~known) > 1e-3) < 1e-3)[:: kernel.step]
    count = len(positions)
    blocks = efforts_by_body(chain, q, v, a)
    columns = np.zeros((len(good), count, len(base.kept)))
    for number, at in enumerate(base.kept):
        body, which = divmod(at, len(PARAMETERS))
        for j in range(body + 1):
            columns[:, j, number] = kernel.apply(blocks[body][:, j, which])[:: kernel.step]
    base_rows, own_rows, targets, ends = [], [], [], [0]
    for j in range(count):
        speed = v[:, j]
        sure = np.abs(speed) > SLOW_SHARE * float(np.max(np.abs(speed), initial=0.0))
        use = good & (kernel.mass(~sure)[:: kernel.step] < 0.25)
        if np.count_nonzero(use) < MIN_ROWS:
            raise ValueError(f"joint {j + 1} hardly moved: it needs more motion, or a longer one")
        own = np.zeros((int(np.count_nonzero(use)), 4 * count))
        own[:, 3 * j] = kernel.apply(np.tanh(speed / (1e-3 + 0.1 * SLOW_SHARE * np.ptp(speed))))[
            :: kernel.step
        ][use]
        own[:, 3 * j + 1] = kernel.apply(speed)[:: kernel.step][use]
        own[:, 3 * j + 2] = 1.0
        own[:, 3 * count + j] = kernel.apply(a[:, j])[:: kernel.step][use]
        base_rows.append(columns[use, j])
        own_rows.append(own)
        effort = efforts[j]
        smooth = sharp.apply(effort) if delay < 0.0 else sharp.apply_held(effort, delay)
        targets.append(kernel.apply(smooth)[:: kernel.step][use])
        ends.append(ends[-1] + len(own))
    whole, beside = np.vstack(base_rows), np.vstack(own_rows)
    kept = list(range(3 * count))
    for j in range(count):  # of the first joint, and of others, a body may say the same
        column = beside[:, 3 * count + j]
        against = np.hstack([whole, beside[:, kept]])
        rest = column - against @ np.linalg.lstsq(against, column, rcond=1e-12)[0]
        if float(np.linalg.norm(rest)) > SAME * float(np.linalg.norm(column)):
            kept.append(3 * count + j)
    return _Rows(whole, beside[:, kept], np.concatenate(targets), np.array(ends[:-1]))


def _solved(columns: Array, target: Array, prior: Array) -> Array:
    """Return coefficients that are believed to be 0 +- 1 where `prior` is 1."""
    size = np.sqrt(np.sum(columns**2, axis=0) / CORRELATED + prior)
    size[size == 0.0] = 1.0
    gram = columns.T @ columns / CORRELATED + np.diag(prior)
    inverse = np.linalg.pinv(gram / np.outer(size, size), rcond=1e-13)
    return np.asarray(inverse @ (columns.T @ target / CORRELATED / size) / size)


def _halves(columns: Array, residual: Array, prior: Array) -> Array:
    """Return half the 95 % intervals, by the scatter of stretches of rows."""
    size = np.sqrt(np.sum(columns**2, axis=0) / CORRELATED + prior)
    size[size == 0.0] = 1.0
    gram = columns.T @ columns / CORRELATED + np.diag(prior)
    inverse = np.linalg.pinv(gram / np.outer(size, size), rcond=1e-13)
    count = max(MIN_STRETCHES, len(residual) // STRETCH)
    edges = np.linspace(0, len(residual), count + 1).astype(int)
    pulls = np.add.reduceat(columns / size * residual[:, None], edges[:-1], axis=0) / CORRELATED
    middle = pulls.T @ pulls + np.diag(prior / size**2)
    return np.asarray(Z_95 * np.sqrt(np.diag(inverse @ middle @ inverse)) / size)


def _by_joint(values: Array, ends: NDArray[np.int64]) -> list[float]:
    return [float(np.sqrt(np.mean(part**2))) for part in np.split(values, ends[1:])]


def _estimates(values: Array, halves: Array) -> tuple[Estimate, ...]:
    return tuple(
        Estimate(float(value), float(value - half), float(value + half))
        for value, half in zip(values, halves, strict=True)
    )


# -- bodies that can exist ----------------------------------------------------------------------


def _bodies_believed(chain: ChainParams) -> list[Array]:
    """Return the parameters of each body, of 1 kg and a radius of 0.1 m where none is believed."""
    bodies = []
    for body in np.split(parameters_of(chain), len(chain.joints)):
        mass = float(body[0])
        if mass <= 0.0:
            body = np.zeros(len(PARAMETERS))
            body[0] = 2.0 * MASS
            body[4:7] = 2.0 * MASS * REACH**2
        bodies.append(body)
    return bodies


def _doubt(body: Array) -> Array:
    """Return by how much each parameter of a body may differ from the belief."""
    mass = float(body[0])
    return np.array([MASS * mass, *[REACH * mass] * 3, *[REACH**2 * mass] * 6])


def _coordinates(body: Array) -> Array:
    """Return the logarithmic Cholesky coordinates of a body's parameters."""
    mass = float(body[0])
    centre = body[1:4] / mass
    inertia = np.array(
        [[body[4], body[7], body[8]], [body[7], body[5], body[9]], [body[8], body[9], body[6]]]
    )
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    about = second / mass - np.outer(centre, centre)
    values, vectors = np.linalg.eigh(about)
    about = (vectors * np.maximum(values, THICK**2 / 3.0)) @ vectors.T
    root = np.linalg.cholesky(about[::-1, ::-1])[::-1, ::-1]  # upper triangular
    logs = np.log(np.diag(root))
    return np.array(
        [0.5 * math.log(mass), *logs, root[0, 1], root[1, 2], root[0, 2], *centre]
    )  # fmt: skip


def _parameters(at: Array) -> Array:
    """Return a body's parameters by its coordinates: any are those of a body that can exist."""
    alpha, d1, d2, d3, s12, s23, s13 = at[:7]
    centre = at[7:10]
    root = np.array([[math.exp(d1), s12, s13], [0.0, math.exp(d2), s23], [0.0, 0.0, math.exp(d3)]])
    mass = math.exp(2.0 * alpha)
    second = mass * (root @ root.T + np.outer(centre, centre))
    inertia = np.trace(second) * np.eye(3) - second
    return np.array(
        [mass, *(mass * centre), inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1],
         inertia[0, 2], inertia[1, 2]]
    )  # fmt: skip


SPREAD = np.array([0.5 * math.log(1.0 + MASS), *[math.log(2.0)] * 3, *[REACH] * 3, *[REACH] * 3])
"""By how much each coordinate may differ from the belief."""


def _plausible(
    rows: _Rows, base: Base, believed: Sequence[Array], noises: Array
) -> tuple[tuple[FoundBody, ...], Array]:
    """Return bodies that can exist by Levenberg and Marquardt's method, and their parameters."""
    whole = np.hstack([rows.base, rows.own]) / noises[:, None]
    gram = whole.T @ whole / CORRELATED
    pull = whole.T @ (rows.target / noises) / CORRELATED
    count = base.share.shape[0]
    rest = np.linalg.pinv(gram[count:, count:], rcond=1e-13)
    across = gram[:count, count:] @ rest
    gram, pull = (
        gram[:count, :count] - across @ gram[count:, :count],
        pull[:count] - across @ pull[count:],
    )
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(size, size))
    sure = values > 1e-13 * values[-1]
    root = np.sqrt(values[sure])[:, None] * vectors[:, sure].T * size
    aim = (vectors[:, sure].T @ (pull / size)) / np.sqrt(values[sure])
    start = np.concatenate([_coordinates(body) for body in believed])
    spread = np.tile(SPREAD, len(believed))

    def bodies(at: Array) -> Array:
        return np.concatenate([_parameters(one) for one in np.split(at, len(believed))])

    def errors(at: Array) -> Array:
        return np.concatenate([root @ base.of(bodies(at)) - aim, (at - start) / spread])

    def slopes(at: Array) -> Array:
        jacobian = np.zeros((len(aim) + len(at), len(at)))
        for number in range(len(at)):
            step = np.zeros(len(at))
            step[number] = 1e-6
            jacobian[:, number] = (errors(at + step) - errors(at - step)) / 2e-6
        return jacobian

    at, damped = start, 1e-3
    now = errors(at)
    for _ in range(STEPS):
        slope = slopes(at)
        normal = slope.T @ slope
        while damped < 1e12:
            step = np.linalg.solve(normal + damped * np.diag(np.diag(normal)), -slope.T @ now)
            step *= min(1.0, 1.0 / max(float(np.max(np.abs(step) / spread)), 1e-300))
            after = errors(at + step)
            if float(after @ after) <= float(now @ now):
                break
            damped *= 4.0
        else:
            break
        small = float(now @ now) - float(after @ after) < 1e-9 * float(now @ now)
        at, now, damped = at + step, after, damped / 4.0
        if small:
            break
    covariance = np.linalg.pinv(slopes(at).T @ slopes(at), rcond=1e-14)
    halves = Z_95 * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    bodies_found = []
    for one, half in zip(np.split(at, len(believed)), np.split(halves, len(believed)), strict=True):
        mass = math.exp(2.0 * one[0])
        ends = (math.exp(2.0 * (one[0] - half[0])), math.exp(2.0 * (one[0] + half[0])))
        x, y, z = _estimates(one[7:10], half[7:10])
        bodies_found.append(FoundBody(Estimate(mass, *ends), (x, y, z), _parameters(one)))
    return tuple(bodies_found), bodies(at)
