"""Impedance of an environment or a hand from recorded force and motion.

Models of the measured force F, with its offset f0 (force sensors have one) and, of a contact, the
depth y = max(0, side (x - surface)):

- spring:        F = f0 + K x + B v
- mass:          F = f0 + K x + B v + M a                     (a hand that holds still, a bench)
- contact:       F = f0 + K y + B dy/dt
- preloaded:     F = f0 + [p + K y + B dy/dt where y > 0]     (a spring held under tension)
- hunt_crossley: F = f0 + k y^n (1 + loss dy/dt)

All terms and F are filtered by one kernel (see `regression`); terms with dy/dt are time derivatives
of functions of y alone, so no velocity is ever formed. Surface and exponent enter nonlinearly and
are found by Gauss and Newton with the linear coefficients eliminated (variable projection). The
customary logarithm ln F = ln k + n ln y + loss dy/dt is not used: it takes ln(1 + loss dy/dt) for
loss dy/dt, a bias of second order in it, blows up the noise of small forces, and cannot hold f0.
Units: N and m, or N m and rad.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.contact_motion import EXPONENTS, Motion, touching_share
from tautwave.analysis.identification.regression import (
    Array,
    Estimate,
    Kernel,
    goodness,
    intervals,
    solve,
    white_noise,
)

MODELS = ("spring", "contact", "preloaded", "hunt_crossley", "mass")
AUTOMATIC = ("spring", "contact", "preloaded", "hunt_crossley")
BETTER = 0.9  # of the residual of a simpler model: so much less, or the simpler one is taken
SURFACES = 40  # places of the surface tried before refining the best
MIN_FREE, MIN_TOUCHING = 0.1, 0.015  # of the samples: less shows no free part, no contact
MIN_ELASTIC = 0.5  # of the force's variance due to stiffness: less means no contact
ROUGH_ROWS = 1000
EXPONENT_RANGE = (1.0, 6.0)  # below 1 a surface would be infinitely stiff


class ContactFit(NamedTuple):
    """One model, fitted.

    `parameters` by name with 95 % intervals: `stiffness`, `damping`, `offset`, and what else the
    model has (`surface`, `preload`, `exponent`, `loss`, `mass`). `side` is +1 when the contact
    fills x > surface, -1 below, 0 without a surface; `sense` is -1 when the measured force pushes
    back against x (the force on the device), +1 when its sign is the other way round.
    `working_stiffness` is dF/dy at the 95th percentile of the depths (of hunt_crossley, whose own
    `stiffness` has an interval for the exponent as found); `elastic_share` the part of
    the force's variance that the stiffness makes. `time_s`, `position`, `effort`, `model`,
    `touching` are the rows used, filtered; `columns` multiply the linear coefficients.
    """

    name: str
    parameters: dict[str, Estimate]
    side: int
    sense: int
    working_stiffness: Estimate
    elastic_share: float
    contact_share: float
    residual_rms: float
    explained: float
    time_s: Array
    position: Array
    effort: Array
    model: Array
    touching: NDArray[np.bool_]
    columns: Array


def fit_contact(motion: Motion, model: str) -> ContactFit | None:
    """Fit one of `MODELS`; None where the motion has nothing of the kind (no free part, ...)."""
    if model in ("spring", "mass"):
        return _finish(motion, model, (), 0)
    start = _rough(motion, model)
    if start is None:
        return None
    theta, side = start
    return _finish(motion, model, _refine(motion, model, theta, side), side)


def choose(fits: Sequence[ContactFit]) -> ContactFit:
    """The first (simplest) of `fits` that no later one beats by more than a tenth of residual."""
    chosen = fits[0]
    for fit in fits[1:]:
        if fit.residual_rms < BETTER * chosen.residual_rms:
            chosen = fit
    return chosen


# -- the models, as columns --------------------------------------------------------------------


def _columns(motion: Motion, model: str, theta: Sequence[float] | Array, side: int) -> Array:
    """Columns of the coefficients; the first is the offset's."""
    one = np.ones(len(motion.rows))
    x = motion.position
    if model in ("spring", "mass"):
        parts = [one, motion.filtered(x), motion.filtered(x, 1)]
        if model == "mass":
            parts.append(motion.filtered(x, 2))
        return np.stack(parts, axis=1)
    depth = np.maximum(side * (x - theta[0]), 0.0)
    if model == "hunt_crossley":
        n = theta[1]
        scale = max(float(depth.max()), 1e-300)  # powers of small depths would underflow
        part = depth / scale
        parts = [one, motion.filtered(part**n), motion.filtered(part ** (n + 1.0), 1)]
        parts[1] *= scale**n
        parts[2] *= scale ** (n + 1.0) / (n + 1.0)
        return np.stack(parts, axis=1)
    parts = [one, motion.filtered(depth), motion.filtered(depth, 1)]
    if model == "preloaded":
        parts.append(motion.filtered(touching_share(side * (x - theta[0]))))
    return np.stack(parts, axis=1)


def _bounds(motion: Motion, side: int) -> tuple[float, float]:
    """Lowest and highest place of the surface, so that something is free and something touches."""
    ordered = np.sort(motion.position)
    below, above = (MIN_FREE, MIN_TOUCHING) if side > 0 else (MIN_TOUCHING, MIN_FREE)
    last = len(ordered) - 1
    return float(ordered[int(below * last)]), float(ordered[int((1.0 - above) * last)])


def _rough(motion: Motion, model: str) -> tuple[tuple[float, ...], int] | None:
    """Side and surface (and exponent) of the best of many tries on a thinned, smoothed motion."""
    thin = slice(None, None, max(1, len(motion.rows) // ROUGH_ROWS))
    x = motion.filtered(motion.position)[thin]
    v = motion.speed[thin]
    target = motion.target[thin]
    one = np.ones_like(x)
    best: tuple[float, tuple[float, ...], int] | None = None
    for side in (1, -1):
        low, high = _bounds(motion, side)
        if not high > low:
            continue
        inner = x[(x > low) & (x < high)]
        places = np.linspace(low, high, SURFACES + 2)[1:-1]
        if len(inner):
            places = np.concatenate([places, np.quantile(inner, np.linspace(0, 1, SURFACES))])
        for place in places:
            depth = np.maximum(side * (x - place), 0.0)
            touching = (depth > 0.0).astype(np.float64)
            for n in EXPONENTS if model == "hunt_crossley" else (1.0,):
                power = depth**n
                rate = side * v * (power if model == "hunt_crossley" else touching)
                parts = [one, power, rate, *([touching] if model == "preloaded" else [])]
                columns = np.stack(parts, axis=1)
                coefficients = solve(columns, target)
                if model == "preloaded" and coefficients[1] * coefficients[3] < 0.0:
                    continue
                cost = float(np.sum((target - columns @ coefficients) ** 2))
                if best is None or cost < best[0]:
                    theta = (float(place), n) if model == "hunt_crossley" else (float(place),)
                    best = (cost, theta, side)
    return None if best is None else best[1:]


def _cost(motion: Motion, model: str, theta: Sequence[float] | Array, side: int) -> float:
    """Sum of squares with the best coefficients; infinite where the model makes no sense."""
    rest, coefficients = _rest(motion, model, theta, side)
    if model == "preloaded" and coefficients[1] * coefficients[3] < 0.0:
        return math.inf  # a force that drops at contact is not a preload
    return float(rest @ rest)


def _rest(
    motion: Motion, model: str, theta: Sequence[float] | Array, side: int
) -> tuple[Array, Array]:
    """Residual and coefficients with surface and exponent given; normal equations, scaled."""
    columns = _columns(motion, model, theta, side)
    size = np.sqrt(np.mean(columns**2, axis=0))
    size[size == 0.0] = 1.0
    columns /= size
    gram = columns.T @ columns
    gram[np.diag_indices_from(gram)] *= 1.0 + 1e-12
    coefficients = np.linalg.lstsq(gram, columns.T @ motion.target, rcond=1e-14)[0]
    return motion.target - columns @ coefficients, coefficients / size


def _refine(motion: Motion, model: str, start: Sequence[float], side: int) -> tuple[float, ...]:
    """Levenberg's method on surface and exponent."""
    theta = np.array(start)
    spread = float(np.ptp(motion.position))
    if model == "preloaded":
        return _search(motion, model, theta, side, 0.03 * spread)
    steps = np.array([1e-4 * spread, 1e-4][: len(theta)])
    cost = _cost(motion, model, theta, side)
    damping = 1e-3
    for _ in range(40):
        slopes = _slopes(motion, model, theta, side, steps)
        rest, _ = _rest(motion, model, theta, side)
        scaled = slopes * steps
        gram = scaled.T @ scaled
        pull = scaled.T @ rest
        gram[np.diag_indices_from(gram)] *= 1.0 + damping
        change = -np.linalg.lstsq(gram, pull, rcond=1e-12)[0] * steps
        tried = _inside(motion, theta + change, side)
        new = _cost(motion, model, tried, side)
        if new < cost:
            done = cost - new < 1e-12 * cost
            theta, cost, damping = tried, new, 0.3 * damping
            if done:
                break
        else:
            damping *= 10.0
            if damping > 1e8:
                break
    return tuple(float(value) for value in theta)


def _search(motion: Motion, model: str, theta: Array, side: int, step: float) -> tuple[float, ...]:
    """Surface of a force that jumps there: not smooth, so tried on ever finer grids."""
    for _ in range(6):
        low, high = _bounds(motion, side)
        places = np.clip(theta[0] + step * np.linspace(-1.0, 1.0, 9), low, high)
        costs = [_cost(motion, model, (float(place),), side) for place in places]
        theta = places[[int(np.argmin(costs))]]
        step *= 0.4
    return (float(theta[0]),)


def _inside(motion: Motion, theta: Array, side: int) -> Array:
    """Keep the surface where something is on both sides of it, and the exponent in bounds."""
    theta = theta.copy()
    theta[0] = np.clip(theta[0], *_bounds(motion, side))
    if len(theta) > 1:
        theta[1] = np.clip(theta[1], *EXPONENT_RANGE)
    return theta


def _slopes(motion: Motion, model: str, theta: Array, side: int, steps: Array) -> Array:
    """Derivative of the projected residual in surface and exponent, by central differences."""
    parts = []
    for at, step in enumerate(steps):
        ahead, behind = theta.copy(), theta.copy()
        ahead[at] += step
        behind[at] -= step
        one, _ = _rest(motion, model, ahead, side)
        two, _ = _rest(motion, model, behind, side)
        parts.append((one - two) / (2.0 * step))
    return np.stack(parts, axis=1)


# -- what comes out ----------------------------------------------------------------------------


def _finish(motion: Motion, model: str, theta: Sequence[float] | Array, side: int) -> ContactFit:
    """Intervals of everything, names and units people use."""
    depth = np.maximum(side * (motion.position - theta[0]), 0.0) if side else np.zeros(1)
    deep = float(np.quantile(depth[depth > 0.0], 0.95)) if np.any(depth > 0.0) else 1.0

    def columns_at(theta: Sequence[float] | Array) -> Array:
        columns = _columns(motion, model, theta, side)
        if model == "hunt_crossley":  # the coefficient is then dF/dy at `deep`, hardly tied to n
            columns[:, 1:] *= deep ** (1.0 - theta[1]) / theta[1]
        return columns

    columns = columns_at(theta)
    coefficients = solve(columns, motion.target)
    predicted = columns @ coefficients
    residual = motion.target - predicted
    slopes = [columns]
    for at, step in zip(
        range(len(theta)), (1e-3 * float(np.ptp(motion.position)), 1e-3), strict=False
    ):
        ahead, behind = list(theta), list(theta)
        ahead[at] += step
        behind[at] -= step
        slopes.append(
            ((columns_at(ahead) - columns_at(behind)) @ coefficients / (2.0 * step))[:, None]
        )
    values = [*(float(value) for value in coefficients), *theta]
    estimates = intervals(np.concatenate(slopes, axis=1), residual, values)
    sign = 1.0 if coefficients[1] >= 0.0 else -1.0
    working = estimates[1].scaled(sign)
    parameters = {"stiffness": working}
    elastic = coefficients[1] * columns[:, 1]
    if model == "hunt_crossley":
        exponent = theta[1]
        parameters["stiffness"] = working.scaled(deep ** (1.0 - exponent) / exponent)
        parameters |= {"exponent": estimates[4], "loss": _ratio(estimates[2], estimates[1])}
    else:
        parameters["damping"] = estimates[2].scaled(sign)
    if model == "mass":
        parameters["mass"] = estimates[3].scaled(sign)
    if model == "preloaded":
        parameters["preload"] = estimates[3].scaled(sign)
        elastic = elastic + coefficients[3] * columns[:, 3]
    touching = np.ones(len(motion.rows), dtype=bool)
    if side:
        touching = motion.filtered((depth > 0.0).astype(np.float64)) > 0.5
        surface = estimates[len(coefficients)]
        if model == "preloaded":  # noise moves the jump, which no derivative of the fit sees
            noise = 0.5 * white_noise(motion.position)
            surface = Estimate(surface.value, surface.lower - noise, surface.upper + noise)
        parameters["surface"] = surface
    parameters["offset"] = estimates[0]
    return ContactFit(
        model,
        parameters,
        side,
        int(sign) * (side or 1),
        working,
        _share(elastic, motion.target),
        float(np.mean(touching)),
        *goodness(motion.target, residual),
        _times(motion.rows, motion.kernel),
        motion.filtered(motion.position),
        motion.target,
        predicted,
        touching,
        columns,
    )


def _times(rows: NDArray[np.int64], kernel: Kernel) -> Array:
    """Times of filtered rows [s]."""
    return np.asarray((rows + kernel.half) * kernel.period, dtype=np.float64)


def _share(part: Array, whole: Array) -> float:
    """Variance of a part over that of the whole."""
    spread = float(np.var(whole))
    return float(np.var(part)) / spread if spread > 0.0 else 0.0


def _ratio(top: Estimate, bottom: Estimate) -> Estimate:
    """Quotient; the interval adds both relative half-widths as if they were independent."""
    if bottom.value == 0.0:
        return Estimate(0.0, -math.inf, math.inf)
    value = top.value / bottom.value
    half = math.hypot(
        0.5 * (top.upper - top.lower) / bottom.value,
        value * 0.5 * (bottom.upper - bottom.lower) / bottom.value,
    )
    return Estimate(value, value - half, value + half)
