"""A device at an environment that is a part: energy and force as external functions.

A step moves by the discrete gradient of the part's stored energy and the mean velocity, so that
work, stored energy and losses add up whatever the part is; steps end at its declared kinks. SI, N m
and rad for N and m on a rotary axis.
"""

from __future__ import annotations

import math
from typing import Callable, NamedTuple  # noqa: UP035 - models import arithmetic only

from tautwave.models.plant_params import PlantParams

_ITERATIONS = 100
_LOCATED = 50
_MAX_SUBSTEPS = 256
_MAX_SPLITS = 32  # of a step, at kinks
_BOUNCE = 100  # steps of the trial that chooses the sub-steps


class PartContact(NamedTuple):
    """An environment part with its numbers.

    `force(params, x, v)` is the effort on the device, `stored(params, x)` the energy held [J],
    `kinks` positions where either bends or jumps, rising; `substeps` those of a step.
    """

    params: tuple[float, ...]
    force: Callable[[tuple[float, ...], float, float], float]
    stored: Callable[[tuple[float, ...], float], float]
    kinks: tuple[float, ...] = ()
    substeps: int = 1


def mean_force(part: PartContact, x: float, u: float, h: float) -> float:
    """Return the part's mean effort on a device that moves by `u` within `h` [s]."""
    middle = x + 0.5 * u
    still = part.force(part.params, middle, 0.0)
    elastic = still
    if math.fabs(u) > 1e-6 * (math.fabs(x) + 1e-3):
        elastic = (part.stored(part.params, x) - part.stored(part.params, x + u)) / u
    return elastic + part.force(part.params, middle, u / h) - still


def _grip(plant: PlantParams, x: float, u: float, reference: float, rate: float, h: float) -> float:
    """Return the mean effort of the grip on the device."""
    ahead = reference + 0.5 * rate * h - x - 0.5 * u
    return plant.grip_stiffness * ahead + plant.grip_damping * (rate - u / h)


def _excess(
    plant: PlantParams, part: PartContact, x: float, v: float, drive: float, u: float, h: float
) -> float:
    """Return what moving by `u` takes more than acts; `drive` is all that does not depend on u."""
    takes = 2.0 * plant.mass * (u / h - v) / h
    takes += (plant.viscous + plant.grip_damping) * u / h + 0.5 * plant.grip_stiffness * u
    return takes - drive - mean_force(part, x, u, h)


def _movement(
    plant: PlantParams, part: PartContact, x: float, v: float, drive: float, h: float
) -> float:
    """Return by how much the device moves within `h`, Coulomb friction included."""
    still = _excess(plant, part, x, v, drive, 0.0, h)
    if math.fabs(still) <= plant.coulomb:
        return 0.0
    friction = plant.coulomb
    if still > 0.0:
        friction = -plant.coulomb
    low, high = 0.0, 0.0
    at_low = still + friction
    at_high = at_low
    reach = h * (math.fabs(v) + h * math.fabs(still) / plant.mass)
    if still > 0.0:
        reach = -reach
    for _ in range(_ITERATIONS):
        high = high + reach
        at_high = _excess(plant, part, x, v, drive, high, h) + friction
        if (at_high > 0.0) != (still > 0.0):
            break
        low, at_low = high, at_high
        reach = 2.0 * reach
    side = 0
    for _ in range(_ITERATIONS):
        middle = (low * at_high - high * at_low) / (at_high - at_low)
        if not min(low, high) < middle < max(low, high):
            middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        value = _excess(plant, part, x, v, drive, middle, h) + friction
        if value == 0.0 or value - value != 0.0:
            return middle
        if (value > 0.0) == (at_high > 0.0):
            high, at_high = middle, value
            if side == 1:
                at_low = 0.5 * at_low
            side = 1
        else:
            low, at_low = middle, value
            if side == -1:
                at_high = 0.5 * at_high
            side = -1
    return 0.5 * (low + high)


def _kink_between(part: PartContact, x: float, u: float) -> float:
    """Return the first kink strictly between x and x + u, NaN without one."""
    first = math.nan
    for kink in part.kinks:
        ahead = kink - x
        inside = 0.0 < ahead < u or u < ahead < 0.0
        if inside and not math.fabs(first - x) <= math.fabs(ahead):
            first = kink
    return first


def part_step(
    plant: PlantParams,
    part: PartContact,
    x: float,
    v: float,
    command: float,
    reference: float,
    rate: float,
    h: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Move by `h` [s] under a constant effort and a hand whose reference has a constant rate.

    Returns
    -------
    tuple
        Position, velocity, work of the hand, and the losses of grip, viscous and Coulomb friction
        and the environment [J]. What an environment gives is a negative loss.
    """
    work = grip_loss = viscous = coulomb = environment = 0.0
    left = h
    span = h / part.substeps
    splits = 0
    while left > 1e-12 * h:
        t = span if span < left else left
        drive = command + _grip(plant, x, 0.0, reference, rate, t)
        u = _movement(plant, part, x, v, drive, t)
        kink = math.nan
        if splits < _MAX_SPLITS:
            kink = _kink_between(part, x, u)
        if kink == kink:
            splits += 1
            t, u = _until(plant, part, x, v, command, reference, rate, t, kink)
        w = u / t
        pull = _grip(plant, x, u, reference, rate, t)
        work += pull * rate * t
        grip_loss += plant.grip_damping * (rate - w) * (rate - w) * t
        viscous += plant.viscous * w * u
        before = part.stored(part.params, x)
        given = mean_force(part, x, u, t) * u
        environment -= given + part.stored(part.params, x + u) - before
        if u == 0.0 and plant.coulomb > 0.0:
            coulomb += 0.5 * plant.mass * v * v  # friction stops it within the step
            v = 0.0
        else:
            coulomb += plant.coulomb * math.fabs(u)
            v = 2.0 * w - v
        x = x + u
        if kink == kink:
            x = kink
        reference = reference + rate * t
        left -= t
    return x, v, work, grip_loss, viscous, coulomb, environment


def _until(
    plant: PlantParams,
    part: PartContact,
    x: float,
    v: float,
    command: float,
    reference: float,
    rate: float,
    h: float,
    kink: float,
) -> tuple[float, float]:
    """Return time until a kink [s] and the movement until then."""
    early, late = 0.0, h
    ahead = kink - x
    for _ in range(_LOCATED):
        t = 0.5 * (early + late)
        drive = command + _grip(plant, x, 0.0, reference, rate, t)
        u = _movement(plant, part, x, v, drive, t)
        if math.fabs(u) < math.fabs(ahead):
            early = t
        else:
            late = t
    drive = command + _grip(plant, x, 0.0, reference, rate, late)
    return late, _movement(plant, part, x, v, drive, late)


def part_forces(
    plant: PlantParams, part: PartContact, x: float, v: float, reference: float, rate: float
) -> tuple[float, float]:
    """Return the efforts of hand and environment on the device."""
    hand = plant.grip_stiffness * (reference - x) + plant.grip_damping * (rate - v)
    return hand, part.force(part.params, x, v)


def part_stored(
    plant: PlantParams, part: PartContact, x: float, v: float, reference: float
) -> tuple[float, float, float]:
    """Return kinetic, grip and environment energy [J]."""
    stretch = reference - x
    return (
        0.5 * plant.mass * v * v,
        0.5 * plant.grip_stiffness * stretch * stretch,
        part.stored(part.params, x),
    )


def part_substeps(
    plant: PlantParams, part: PartContact, x: float, speed: float, period: float, error: float
) -> int:
    """Return the sub-steps per period for which a bounce is right to `error` of its speed.

    Tried from 1 on by doubling: a device that enters at `speed` from x or from each kink, both
    ways, against one with twice the sub-steps; at most 256.
    """
    steps = 1
    free = plant._replace(coulomb=0.0, grip_stiffness=0.0, grip_damping=0.0)
    starts = (x, *part.kinks)
    while steps < _MAX_SUBSTEPS:
        worst = 0.0
        for start in starts:
            for way in (speed, -speed):
                count = _BOUNCE // steps + 1
                one = _bounce(free, part._replace(substeps=steps), start, way, period, count)
                two = _bounce(free, part._replace(substeps=2 * steps), start, way, period, count)
                worst = max(worst, math.fabs(one - two))
        if worst <= error * speed:
            return steps
        steps = 2 * steps
    return steps


def _bounce(
    plant: PlantParams, part: PartContact, x: float, v: float, period: float, count: int
) -> float:
    """Return the velocity after a trial of this many periods [m/s or rad/s]."""
    for _ in range(count):
        x, v, *_rest = part_step(plant, part, x, v, 0.0, 0.0, 0.0, period)
    return v
