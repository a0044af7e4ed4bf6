"""What weighs on joints, from slow motion: least squares on what is linear in masses and moments.

The motors' efforts are filtered as the motion is. What is left of them beside the believed
inertial efforts is weight, Coulomb and viscous friction and the motors' own inertia. What the
motion does not tell apart is decided by the belief, which is wrong by a stated amount (least
squares with a Gaussian prior), so that a parameter of which it says nothing stays as believed. SI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import (
    BLOCKS,
    Z_95,
    Array,
    Estimate,
    Kernel,
    solve,
    white_noise,
)

SLOW = 6.0
"""Velocity below which friction has no known sign, in deviations of the velocity's noise."""

MIN_ROWS = 60


class Moved(NamedTuple):
    """Filtered motion of one joint; `rows` are 1 where they count, `direction` is its sign."""

    rows: Array
    position: Array
    velocity: Array
    acceleration: Array
    effort: Array
    direction: Array


class WeightFit(NamedTuple):
    """Changes of the parameters, frictions, and residuals by joint.

    `before` and `after` [N m or N] are the root mean squares of what the believed and the found
    loads leave of the efforts, friction and inertia taken out of both.
    """

    found: tuple[Estimate, ...]
    coulomb: tuple[Estimate, ...]
    damping: tuple[Estimate, ...]
    before: tuple[float, ...]
    after: tuple[float, ...]


def moved(
    position: Array,
    effort: Array,
    known: NDArray[np.bool_],
    period: float,
    delay: float,
    cutoff_hz: float,
) -> Moved:
    """Return the motion of one joint behind the filter; rows where it moves and was measured.

    Raises
    ------
    ValueError
        It hardly moved.
    """
    kernel = Kernel(period, cutoff_hz)
    if len(position) <= 2 * kernel.half:
        raise ValueError("the recording is too short; move the axis for longer")
    velocity = kernel.apply(position, 1)
    sharp = Kernel(period, 4.0 * cutoff_hz)
    quick = np.zeros_like(position)
    quick[sharp.half : len(position) - sharp.half] = sharp.apply(position, 1)
    noise = white_noise(position) * kernel.noise_gain(1)
    certain = np.abs(velocity) > max(SLOW * noise, 0.02 * float(np.max(np.abs(velocity))))
    use = certain & (kernel.mass(~known) < 1e-3)
    rows = np.zeros(len(use), dtype=bool)
    rows[:: kernel.step] = True
    rows &= use
    if np.count_nonzero(rows) < MIN_ROWS:
        raise ValueError("it hardly moved: increase the amplitude or the duration")
    return Moved(
        rows.astype(np.float64),
        kernel.apply(position),
        velocity,
        kernel.apply(position, 2),
        kernel.apply_held(effort, delay),
        kernel.apply(np.sign(quick)),
    )


def fit_weights(
    joints: Sequence[Moved],
    every: NDArray[np.int64],
    believed: Array,
    columns: Array,
    scales: Sequence[float],
) -> WeightFit:
    """Fit what weighs on several joints.

    Parameters
    ----------
    joints : sequence of Moved
        Their motion.
    every : array of int, (rows,)
        The rows at which `believed` and `columns` are given.
    believed : array, (rows, joints)
        Effort of the motors for the believed weight and inertia [N m or N].
    columns : array, (rows, joints, parameters)
        How that changes with each parameter.
    scales : sequence of float
        By how much each parameter may differ from the belief, as a standard deviation.
    """
    count = len(joints)
    blocks, targets, own = [], [], []
    for j, joint in enumerate(joints):
        mask = joint.rows[every] > 0.5
        at = every[mask]
        friction = np.zeros((len(at), 3 * count))
        friction[:, 3 * j] = joint.direction[at]
        friction[:, 3 * j + 1] = joint.velocity[at]
        friction[:, 3 * j + 2] = joint.acceleration[at]
        blocks.append(columns[mask, j, :])
        own.append(friction)
        targets.append(joint.effort[at] - believed[mask, j])
    weights, frictions, target = np.vstack(blocks), np.vstack(own), np.concatenate(targets)
    spans = np.asarray(scales, dtype=np.float64)
    whole = np.hstack([weights * spans, frictions])
    ends = np.cumsum([len(part) for part in targets])[:-1]
    noises = [_rms(part) for part in np.split(target - whole @ solve(whole, target), ends)]
    least = max(1e-3 * max(noises), 1e-12)  # a joint that nothing disturbs would decide alone
    rows = np.concatenate(
        [np.full(len(p), 1.0 / max(n, least)) for p, n in zip(targets, noises, strict=True)]
    )
    trust = np.zeros(whole.shape[1])
    trust[: len(spans)] = 1.0
    values, halves = _with_belief(rows[:, None] * whole, rows * target, trust)
    fitted = [
        Estimate(float(s * v), float(s * (v - h)), float(s * (v + h)))
        for v, h, s in zip(values, halves, spans, strict=False)
    ]
    rest = [
        Estimate(float(value), float(value - half), float(value + half))
        for value, half in zip(values[len(spans) :], halves[len(spans) :], strict=True)
    ]
    plain = target - frictions @ solve(frictions, target)
    return WeightFit(
        tuple(fitted),
        tuple(rest[0::3]),
        tuple(rest[1::3]),
        tuple(_rms(part) for part in np.split(plain, ends)),
        tuple(_rms(part) for part in np.split(target - whole @ values, ends)),
    )


def _with_belief(columns: Array, target: Array, trust: Array) -> tuple[Array, Array]:
    """Return coefficients that are believed to be 0, and half their 95 % intervals.

    `trust` is the weight of the belief that a coefficient is 0 +- 1. The residual's share of the
    covariance is the scatter of stretches of rows, as in `regression.intervals`.
    """
    size = np.sqrt(np.mean(columns**2, axis=0))
    size = np.maximum(size, 1e-6 * float(np.max(size)))
    scaled, prior = columns / size, np.diag(trust / size**2)
    inverse = np.linalg.pinv(scaled.T @ scaled + prior, rcond=1e-14)
    values = inverse @ (scaled.T @ target)
    residual = target - scaled @ values
    edges = np.linspace(0, len(residual), BLOCKS + 1).astype(int)
    pulls = np.add.reduceat(scaled * residual[:, None], edges[:-1], axis=0)
    believed = np.diag(trust**2 / size**2)
    covariance = inverse @ (pulls.T @ pulls + believed) @ inverse
    return values / size, Z_95 * np.sqrt(np.diag(covariance)) / size


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
