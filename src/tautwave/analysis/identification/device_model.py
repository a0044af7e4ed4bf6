"""Inertia, viscous and Coulomb friction of a device from the effort it got and how it moved.

`m a + b v + c sign(v) = effort + bias`, every term filtered by one kernel (see `regression`). A
lever with a weight has `cosine cos x + sine sin x` beside the bias, as a rig's `load` states it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import (
    Array,
    Estimate,
    Kernel,
    goodness,
    intervals,
    solve,
    white_noise,
)

SIGN_NOISE = 4.0  # standard deviations a velocity has to be from zero for its sign to be known
UNSIGNED_SHARE = 0.25  # of the kernel that may fall on samples whose sign is not known
STUCK_SHARE = 0.02  # of the kernel that may fall on turning points where it may have stuck
METHOD = 1e-3  # of a value: what is left of turning points between samples, of uneven noise
MIN_ROWS = 60


class DeviceFit(NamedTuple):
    """A device's constants with 95 % intervals; rotary: N m and rad, linear: N and m.

    `bias` is a constant effort from outside, such as a weight. `time_s`, `effort`, `model` are
    the filtered rows that were used and what the model says of them. `sensor_noise` is the
    standard deviation of the position's white noise [rad or m]; `peak_velocity` [rad/s or m/s];
    `outside` the effort on the device for a unit of what a sensor shows, where there was one;
    `weight` cosine and sine of what the position turns [N m], where that was asked for.
    """

    inertia: Estimate
    damping: Estimate
    coulomb: Estimate
    bias: Estimate
    residual_rms: float
    explained: float
    sensor_noise: float
    peak_velocity: float
    time_s: Array
    effort: Array
    model: Array
    outside: Estimate | None = None
    weight: tuple[Estimate, Estimate] | None = None


def fit_device(
    position: Array,
    effort: Array,
    period: float,
    *,
    cutoff_hz: float,
    delay: float = 0.0,
    known: NDArray[np.bool_] | None = None,
    outside: Array | None = None,
    weighs: bool = False,
) -> DeviceFit:
    """Fit a device that moved freely under a held effort.

    The noise of the position is in the filtered velocity and acceleration too, where least
    squares would take it for motion and find everything too small; its share of the normal
    equations is known from the kernel and is taken out. Rows in which friction has no known sign
    (the device stuck, or slower than its noise) are left out: a stuck device says nothing.

    Parameters
    ----------
    position : array, (n,)
        Measured [rad or m], one sample a period.
    effort : array, (n,)
        Commanded [N m or N], each held for one period from its sample on.
    period : float
        [s].
    cutoff_hz : float
        Of the filter; twice the highest frequency of the excitation is a good choice.
    delay : float
        Periods until a command acts.
    known : array of bool, optional
        Samples that were measured; the others are filled in, and not used.
    outside : array, (n,), optional
        What a sensor of the effort from outside shows, whose scale is fitted as well.
    weighs : bool
        Whether a weight that the position turns is fitted as well.

    Raises
    ------
    ValueError
        The device did not move enough to tell anything.
    """
    kernel = Kernel(period, cutoff_hz)
    noise = white_noise(position, known)
    sharp = Kernel(period, 2.0 * cutoff_hz)
    velocity = np.zeros_like(position)
    velocity[sharp.half : len(position) - sharp.half] = sharp.apply(position, 1)
    certain = np.abs(velocity) > max(
        SIGN_NOISE * noise * sharp.noise_gain(1), 1e-3 * float(np.max(np.abs(velocity), initial=0))
    )
    # The mean sign over the sample's period, given the velocity's noise: rounded to +-1, turning
    # points would bias everything, friction first.
    inner = slice(sharp.half, len(position) - sharp.half)
    blur = np.full_like(position, math.inf)
    blur[inner] = np.hypot(
        period * np.abs(sharp.apply(position, 2)) / math.sqrt(12.0), noise * sharp.noise_gain(1)
    )
    ratio = np.clip(velocity / np.maximum(blur, 1e-300), -9.0, 9.0)
    sign = np.tanh(0.7979 * ratio * (1.0 + 0.0447 * ratio * ratio))  # erf(ratio / sqrt 2)
    use = kernel.mass(~certain) < UNSIGNED_SHARE
    if known is not None:
        use &= kernel.mass(~known) < 1e-3
    signs = kernel.apply(sign)
    felt = [] if outside is None else [kernel.apply(outside)]
    if weighs:
        felt += [kernel.apply(np.cos(position)), kernel.apply(np.sin(position))]
    rows, columns, target, coefficients = _solve_rows(
        kernel, position, effort, delay, signs, use, noise, felt
    )
    beside = [] if outside is None else [outside]
    beside += [np.cos(position), np.sin(position)] if weighs else []
    total = effort + sum(
        (factor * one for factor, one in zip(coefficients[4:], beside, strict=True)),
        np.zeros_like(effort),
    )
    stuck = _may_stick(velocity, total, delay, coefficients[:4], sharp)
    moving = use & (kernel.mass(stuck) < STUCK_SHARE)
    if np.count_nonzero(moving) > 0.3 * np.count_nonzero(use):
        rows, columns, target, coefficients = _solve_rows(
            kernel, position, effort, delay, signs, moving, noise, felt
        )
    residual = target - columns @ coefficients
    inertia, damping, coulomb, bias, *rest = intervals(columns, residual, list(coefficients))
    scale = None if outside is None else rest.pop(0)
    inertia, damping, coulomb = (_widened(e) for e in (inertia, damping, coulomb))
    return DeviceFit(
        inertia,
        damping,
        coulomb,
        bias,
        *goodness(target, residual),
        noise,
        float(np.max(np.abs(columns[:, 1]))),
        np.asarray((rows + kernel.half) * period, dtype=np.float64),
        target,
        columns @ coefficients,
        scale,
        (rest[0], rest[1]) if weighs else None,
    )


def _widened(estimate: Estimate) -> Estimate:
    """The interval with the method's own error, added as an independent one."""
    value = estimate.value
    half = math.hypot(0.5 * (estimate.upper - estimate.lower), METHOD * value)
    return Estimate(value, value - half, value + half)


def _solve_rows(
    kernel: Kernel,
    position: Array,
    effort: Array,
    delay: float,
    signs: Array,
    use: NDArray[np.bool_],
    noise: float,
    felt: Sequence[Array],
) -> tuple[NDArray[np.int64], Array, Array, Array]:
    """Rows, columns, target and coefficients; the rows are those marked, thinned."""
    rows = np.flatnonzero(use)[:: kernel.step]
    if len(rows) < MIN_ROWS:
        raise ValueError(
            "the device hardly moved: it exceeded its sensor's noise for only "
            f"{len(rows) * kernel.step * kernel.period:.2g} s"
        )
    parts = [kernel.apply(position, 2)[rows], kernel.apply(position, 1)[rows], signs[rows]]
    parts.append(np.full(len(rows), -1.0))
    parts += [-one[rows] for one in felt]
    columns = np.stack(parts, axis=1)
    target = kernel.apply_held(effort, delay)[rows]
    return rows, columns, target, _without_noise(columns, target, noise, kernel)


def _may_stick(
    velocity: Array, effort: Array, delay: float, found: Array, sharp: Kernel
) -> NDArray[np.bool_]:
    """Turning points at which the effort was below the friction: there friction is not c."""
    inertia, _, coulomb, bias = (float(value) for value in found)
    if not (inertia > 0.0 and coulomb > 0.0):
        return np.zeros(len(velocity), dtype=bool)
    smear = 3.0 * coulomb / inertia * sharp.width * sharp.period  # of a kink in the velocity
    reach = int(delay) + 2
    weak = np.abs(effort + bias) < 1.2 * coulomb
    near = np.convolve(weak, np.ones(2 * reach + 1), mode="same") > 0.5
    return np.asarray(near & (np.abs(velocity) < smear), dtype=bool)


def _without_noise(columns: Array, target: Array, noise: float, kernel: Kernel) -> Array:
    """Coefficients from normal equations less what the sensor's noise adds to them."""
    plain = solve(columns, target)
    extra = np.zeros(columns.shape[1])
    for at, order in ((0, 2), (1, 1)):
        extra[at] = len(columns) * (noise * kernel.noise_gain(order)) ** 2
    gram = columns.T @ columns
    if np.any(extra > 0.2 * np.diag(gram)):
        return plain  # so much noise that nothing can be mended; the interval says so
    return np.asarray(np.linalg.solve(gram - np.diag(extra), gram @ plain), dtype=np.float64)
