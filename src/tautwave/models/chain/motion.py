"""A serial chain in motion: joints with motors, friction, hands and contacts; SI units.

One implicit step that keeps the energy: with mean speeds w = (v + v')/2 over the step h,

    M (v' - v) + h (C(w) w + g) + s M w = h f(w)

where M is the mean of the mass matrices at both ends, C and g are taken half-way, and the factor s,
of third order, makes kinetic and potential energy change by exactly the work of f (a discrete
gradient of Gonzalez' kind). Springs act by their mean over the step; Coulomb friction is
set-valued: a joint is stuck where it can be.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tautwave.models.chain.friction import speeds_under_friction
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.inertia import (
    BASE,
    chain_bodies,
    chain_coriolis,
    chain_screws,
    mass_matrix,
)
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.params import ChainParams
from tautwave.models.plant_params import PlantParams

ITERATIONS = 30
CONVERGED = 1e-12
"""Change of the speeds [rad/s or m/s] from one iteration to the next, per the greatest speed."""

DIVERGED = 100.0
"""The same per the least change so far, where nothing more comes of it."""

HALVINGS = 6
"""So that a step takes 127 tries at most, of `ITERATIONS` each."""

CLOSED = 1e-9
"""Energy [J] that a step may be wrong by, per kinetic energy before and after it and `SMALL`."""
SMALL = 1e-3
ROUNDING = 1e-14
"""The same per potential and work [J]: what their sums lose."""

BENT = 0.05
"""Part of the chain's momentum that the correction may take or give in a step: of third order as
it is, with more than that the books close and the motion is another one."""

LEAST = 1e-6
"""Twice the kinetic energy [J] of the mean speeds, below which the correction is left out: being of
third order, it is lost in rounding."""


class Placed(NamedTuple):
    """Mass matrix row by row, motors' inertia included, and potential energy [J] at a posture."""

    matrix: list[float]
    potential: float


class Acting(NamedTuple):
    """What acts on a joint from outside over a step: its motor, and its hand's moving reference.

    `effort` [N m or N]; `reference` [rad or m] is that at the start, `rate` its speed.
    """

    effort: float
    reference: float
    rate: float


class Flows(NamedTuple):
    """Energy of one joint over a step [J], and what its hand and contact lose."""

    hand_work: float
    motor_work: float
    grip_loss: float
    viscous_loss: float
    coulomb_loss: float
    environment_loss: float
    given: float
    """Into the chain's kinetic and potential energy."""


class Moved(NamedTuple):
    """Where a step leads: positions, speeds, each joint's energies, the chain as it is there."""

    x: list[float]
    v: list[float]
    flows: list[Flows]
    place: Placed


def place_chain(c: ChainParams, plants: Any, x: Any) -> Placed:
    """Return mass matrix and potential at the positions `x` [rad or m]."""
    count = len(x)
    frames = chain_frames(c, x)
    matrix = [0.0] * (count * count)
    weight = [0.0] * count
    potential = mass_matrix(c, x, frames, chain_screws(frames), BASE, matrix, weight)
    for i in range(count):
        matrix[i * count + i] += plants[i].mass
    return Placed(matrix, potential)


def kinetic_energy(matrix: Any, v: Any) -> float:
    """Return the kinetic energy [J] at the speeds `v` [rad/s or m/s]."""
    count = len(v)
    total = 0.0
    for i in range(count):
        row = 0.0
        for j in range(count):
            row += matrix[i * count + j] * v[j]
        total += v[i] * row
    return 0.5 * total


def chain_step(
    c: ChainParams,
    plants: tuple[PlantParams, ...],
    here: Placed,
    x: list[float],
    v: list[float],
    guess: list[float],
    acting: list[Acting],
    h: float,
    halvings: int = HALVINGS,
) -> Moved:
    """Move a chain on by `h` [s] under constant efforts.

    A step whose balance does not close, or closes by a correction that bends the motion, is made
    in two halves, and these in halves, `halvings` times at most: joints that turn by a tenth of a
    radian and more in a step need it. Should that not do, the best iterate stands, with a loss in
    place of a gain; by how much shows where kinetic and potential energy differ from `given`.

    Parameters
    ----------
    c : ChainParams
        The chain.
    plants : tuple of PlantParams
        Per joint the motor's inertia with the hand's, friction, grip and contact.
    here : Placed
        At the positions `x`.
    x, v : list of float
        Positions [rad or m] and speeds.
    guess : list of float
        Speeds to begin the iteration with.
    acting : list of Acting
        On each joint.
    halvings : int
        How often the step may be halved.

    Returns
    -------
    Moved
        Of a step in halves the energies are those of both.
    """
    moved, share = _tried(c, plants, here, x, v, guess, acting, h)
    if _closed(here, v, moved, share):
        return moved
    if halvings == 0:
        return _cut(here, v, moved)
    h = 0.5 * h
    first = chain_step(c, plants, here, x, v, v, acting, h, halvings - 1)
    later = [one._replace(reference=one.reference + h * one.rate) for one in acting]
    place, x, v = first.place, first.x, first.v
    last = chain_step(c, plants, place, x, v, v, later, h, halvings - 1)
    flows = [
        Flows(*(a + b for a, b in zip(one, other, strict=True)))
        for one, other in zip(first.flows, last.flows, strict=True)
    ]
    return last._replace(flows=flows)


def _closed(here: Placed, v: list[float], moved: Moved, share: float) -> bool:
    """Return whether the chain's energy changed by what its joints gave, hardly corrected."""
    before = kinetic_energy(here.matrix, v)
    after = kinetic_energy(moved.place.matrix, moved.v)
    given = sum(flow.given for flow in moved.flows)
    off = after - before + moved.place.potential - here.potential - given
    rounding = ROUNDING * (abs(here.potential) + abs(given))
    mean = [0.5 * (a + b) for a, b in zip(v, moved.v, strict=True)]
    bent = share * share * kinetic_energy(moved.place.matrix, mean)
    scale = before + after + SMALL
    return abs(off) <= CLOSED * scale + rounding and bent <= BENT * BENT * scale


def _cut(here: Placed, v: list[float], moved: Moved) -> Moved:
    """Return an open step that loses by as much as it had gained: what gains would run away."""
    given = sum(flow.given for flow in moved.flows)
    there = kinetic_energy(here.matrix, v) + here.potential + given - moved.place.potential
    after = kinetic_energy(moved.place.matrix, moved.v)
    if after <= there:
        return moved
    share = math.sqrt(max(2.0 * there - after, 0.0) / after) if after < math.inf else 0.0
    return moved._replace(v=[share * w for w in moved.v])


def _tried(
    c: ChainParams,
    plants: tuple[PlantParams, ...],
    here: Placed,
    x: list[float],
    v: list[float],
    guess: list[float],
    acting: list[Acting],
    h: float,
) -> tuple[Moved, float]:
    """Return one step as the best iterate has it, and the factor s that it was found with."""
    count = len(x)
    mean = [0.5 * (a + b) for a, b in zip(v, guess, strict=True)]
    signs = [math.copysign(1.0, w) if w != 0.0 else 0.0 for w in mean]
    weight = [0.0] * count
    swung = [0.0] * count
    least = math.inf
    best = mean
    bends = 0.0
    for _ in range(ITERATIONS):
        end = [a + h * w for a, w in zip(x, mean, strict=True)]
        there = place_chain(c, plants, end)
        frames = chain_frames(c, [0.5 * (a + b) for a, b in zip(x, end, strict=True)])
        chain_gravity(c, frames, weight)
        chain_coriolis(chain_bodies(c, frames), chain_screws(frames), mean, swung)
        half = [0.5 * (a + b) for a, b in zip(here.matrix, there.matrix, strict=True)]
        share = _correction(here, there, half, v, mean, weight, swung, h)
        matrix = [(2.0 + share) * m for m in half]
        right = [0.0] * count
        for i in range(count):
            held, slope = _external(plants[i], acting[i], x[i], end[i], h)
            row = 0.0
            for j in range(count):
                row += half[i * count + j] * v[j]
            right[i] = 2.0 * row + h * (held - weight[i] - swung[i])
            matrix[i * count + i] += h * slope
        next_mean = speeds_under_friction(matrix, right, [h * p.coulomb for p in plants], signs)
        change = max(abs(a - b) for a, b in zip(next_mean, mean, strict=True))
        mean = next_mean
        if change < least:
            least = change
            best = next_mean
            bends = share
        elif change > DIVERGED * least:
            break
        if change <= CONVERGED * max(1.0, max(abs(w) for w in mean)):
            break
    mean = best
    end = [a + h * w for a, w in zip(x, mean, strict=True)]
    speeds = [2.0 * w - a for w, a in zip(mean, v, strict=True)]
    flows = [_flows(plants[i], acting[i], x[i], end[i], mean[i], h) for i in range(count)]
    return Moved(end, speeds, flows, place_chain(c, plants, end)), bends


def _correction(
    here: Placed,
    there: Placed,
    half: list[float],
    v: list[float],
    mean: list[float],
    weight: list[float],
    swung: list[float],
    h: float,
) -> float:
    """Return the factor s by which the energy is kept exactly, at most 1 of either sign.

    Beyond that the iteration has not come near: the matrix stays definite, the step is halved.
    """
    count = len(v)
    after = [2.0 * w - a for w, a in zip(mean, v, strict=True)]
    turned = 0.0
    energy = 0.0
    for i in range(count):
        for j in range(count):
            k = i * count + j
            grown = there.matrix[k] - here.matrix[k]
            turned += grown * (after[i] * after[j] + v[i] * v[j])
            energy += half[k] * mean[i] * mean[j]
    lacking = 0.25 * turned + there.potential - here.potential
    for i in range(count):
        lacking -= h * mean[i] * (weight[i] + swung[i])
    return max(min(lacking / energy, 1.0), -1.0) if energy > LEAST else 0.0


def _wall(p: PlantParams, x: float, end: float) -> float:
    """Return the mean push of the wall's spring over the step [N m or N], along its normal."""
    first = p.wall_side * (x - p.wall_position)
    last = p.wall_side * (end - p.wall_position)
    if first <= 0.0 and last <= 0.0:
        return 0.0
    if (first > 0.0 and last > 0.0) or last == first:
        return 0.5 * p.wall_stiffness * (first + last)
    deep = max(last, 0.0)
    before = max(first, 0.0)
    return 0.5 * p.wall_stiffness * (deep * deep - before * before) / (last - first)


def _external(p: PlantParams, on: Acting, x: float, end: float, h: float) -> tuple[float, float]:
    """Return a joint's mean effort without motion, and how it falls with the mean speed."""
    effort, reference, rate = on
    held = effort + p.grip_stiffness * (reference + 0.5 * h * rate - x) + p.grip_damping * rate
    slope = 0.5 * h * (p.grip_stiffness + p.spring_stiffness) + p.grip_damping + p.viscous
    if p.spring_stiffness > 0.0:
        held -= p.spring_stiffness * (x - p.spring_position)
    if p.wall_stiffness > 0.0 or p.wall_damping > 0.0:
        push, rise = _push(p, x, end, h)
        # Linear about the end so far: fixed points alone run away where h h k or h d exceeds m.
        held -= p.wall_side * push + rise * (x - end)
        slope += h * rise
    return held, slope


def _push(p: PlantParams, x: float, end: float, h: float) -> tuple[float, float]:
    """Return the mean push of the wall, spring and damper, and how it rises with the way in.

    It never pulls, and the damper acts on the part of the way that is in the wall: so the push
    [N m or N] is convex in the end, and its slope [N m/rad or N/m] never below 0.
    """
    first = p.wall_side * (x - p.wall_position)
    last = p.wall_side * (end - p.wall_position)
    before = max(first, 0.0)
    deep = max(last, 0.0)
    push = _wall(p, x, end) + p.wall_damping * (deep - before) / h
    if push <= 0.0:
        return 0.0, 0.0
    rise = p.wall_damping / h if last > 0.0 else 0.0
    if (first > 0.0 and last > 0.0) or last == first:
        return push, rise + 0.5 * p.wall_stiffness
    way = last - first
    grown = 2.0 * deep * way - (deep * deep - before * before)
    return push, rise + 0.5 * p.wall_stiffness * grown / (way * way)


def _flows(p: PlantParams, on: Acting, x: float, end: float, mean: float, h: float) -> Flows:
    effort, reference, rate = on
    moved = end - x
    ahead = reference + 0.5 * h * rate - 0.5 * (x + end)
    slip = rate - mean
    grip = p.grip_stiffness * ahead + p.grip_damping * slip
    spring = p.spring_stiffness * (0.5 * (x + end) - p.spring_position)
    push = 0.0
    wall = 0.0
    if p.wall_stiffness > 0.0 or p.wall_damping > 0.0:
        push, _ = _push(p, x, end, h)
        wall = _wall(p, x, end)
    rubbed = p.coulomb * abs(moved)
    viscous = p.viscous * mean * moved
    work = effort * moved
    given = work + (grip - spring - p.wall_side * push) * moved - viscous - rubbed
    return Flows(
        rate * h * grip,
        work,
        p.grip_damping * slip * slip * h,
        viscous,
        rubbed,
        (push - wall) * p.wall_side * moved,
        given,
    )
