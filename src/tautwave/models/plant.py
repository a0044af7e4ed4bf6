"""Impedance-axis plant: a mass with friction, held by a hand, at a spring or a one-sided wall.

`m a = effort + grip + environment - viscous v - coulomb sign(v)`. The effort is constant over a
step and the hand's reference moves linearly, so between events a step is an exact linear map.
"""

from __future__ import annotations

import math

from tautwave.models.plant_params import PlantCache, PlantParams, plant_cache
from tautwave.models.switching import (
    CLIPPED,
    FREE,
    PRESSING,
    SLIDING_DOWN,
    SLIDING_UP,
    STUCK,
    PlantStep,
    contact_mode,
    switching_step,
)

__all__ = [
    "CLIPPED",
    "FREE",
    "PRESSING",
    "SLIDING_DOWN",
    "SLIDING_UP",
    "STUCK",
    "PlantCache",
    "PlantParams",
    "PlantStep",
    "plant_cache",
    "plant_forces",
    "plant_step",
    "plant_stored",
]


def plant_step(
    p: PlantParams,
    c: PlantCache,
    x: float,
    v: float,
    mode: int,
    effort: float,
    reference: float,
    reference_rate: float,
    h: float,
) -> PlantStep:
    """Move plant `p` on by `h` [s] under a constant `effort` [N m or N].

    Parameters
    ----------
    c
        `plant_cache(p, step)`; the fast path is taken when `h` equals its step and a bound shows
        that no contact or friction event can happen.
    mode
        Mode the step before returned, FREE (0) at first: contact plus friction code.
    reference, reference_rate
        Hand's reference position at the start and its velocity over the step.

    Returns
    -------
    tuple
        x, v, mode, then over the step in J: work of the reference on the grip, and the losses of
        grip, viscous friction, Coulomb friction and environment. Work and losses are integrals of
        their own: `hand_work + effort dx = d stored + losses` up to rounding.
    """
    # Bound once: in plain Python every `c.free.xv` below would be two look-ups.
    free = c.free
    pressing = c.pressing
    grip_stiffness = p.grip_stiffness
    grip_damping = p.grip_damping
    viscous = p.viscous
    force = (
        effort
        + grip_stiffness * (reference - x)
        + grip_damping * (reference_rate - v)
        - viscous * v
    )
    if c.has_spring:
        force = force - p.spring_stiffness * (x - p.spring_position)
    slope = grip_stiffness * reference_rate
    friction = 0.0
    code = 0
    contact = FREE
    depth = 0.0
    if c.has_wall:
        depth = p.wall_side * (x - p.wall_position)
        if not depth < 0.0:
            contact = contact_mode(p, mode, depth, v)
    if h != c.step or contact == CLIPPED:
        return switching_step(p, c, contact, x, v, effort, reference, reference_rate, h)
    if contact == PRESSING:
        force = force - (p.wall_stiffness * (x - p.wall_position) + p.wall_damping * v)
    if c.has_coulomb:
        if v == 0.0:
            later = force + slope * h
            if force > p.coulomb or force < -p.coulomb or later > p.coulomb or later < -p.coulomb:
                return switching_step(p, c, contact, x, v, effort, reference, reference_rate, h)
            swept = reference_rate * h
            grip = grip_stiffness * (reference - x + 0.5 * swept)
            grip = grip + grip_damping * reference_rate
            loss = grip_damping * reference_rate * swept
            return x, v, contact + STUCK, swept * grip, loss, 0.0, 0.0, 0.0
        friction = p.coulomb
        code = SLIDING_UP
        if v < 0.0:
            friction = -friction
            code = SLIDING_DOWN
        force = force - friction
        swing = free.swing
        if contact == PRESSING:
            swing = pressing.swing
        margin = h * (math.fabs(force) + h * math.fabs(slope)) - p.mass * math.fabs(v) * (
            1.0 - swing
        )
        if not margin < 0.0:
            return switching_step(p, c, contact, x, v, effort, reference, reference_rate, h)
    environment_loss = 0.0
    if contact == PRESSING:
        speed = math.fabs(v) + pressing.reach * (math.fabs(force) + h * math.fabs(slope))
        if not p.wall_stiffness * (depth - h * speed) - p.wall_damping * speed > 0.0:
            return switching_step(p, c, contact, x, v, effort, reference, reference_rate, h)
        moved = pressing.xv * v + pressing.xn * force + pressing.xs * slope
        gained = pressing.vv * v + pressing.vn * force + pressing.vs * slope
        area = pressing.av * v + pressing.an * force + pressing.as_ * slope
        square = (
            v * (pressing.qvv * v + pressing.qvn * force + pressing.qvs * slope)
            + force * (pressing.qnn * force + pressing.qns * slope)
            + pressing.qss * slope * slope
        )
        environment_loss = p.wall_damping * square
    else:
        if c.has_wall:
            speed = math.fabs(v) + free.reach * (math.fabs(force) + h * math.fabs(slope))
            if not depth + h * speed < 0.0:
                return switching_step(p, c, contact, x, v, effort, reference, reference_rate, h)
        moved = free.xv * v + free.xn * force + free.xs * slope
        gained = free.vv * v + free.vn * force + free.vs * slope
        area = free.av * v + free.an * force + free.as_ * slope
        square = (
            v * (free.qvv * v + free.qvn * force + free.qvs * slope)
            + force * (free.qnn * force + free.qns * slope)
            + free.qss * slope * slope
        )
    swept = reference_rate * h
    grip = grip_stiffness * (h * (reference - x + 0.5 * swept) - area)
    grip = grip + grip_damping * (swept - moved)
    return (
        x + moved,
        v + gained,
        contact + code,
        reference_rate * grip,
        grip_damping * (square + reference_rate * (swept - 2.0 * moved)),
        viscous * square,
        friction * moved,
        environment_loss,
    )


def plant_stored(
    p: PlantParams, x: float, v: float, reference: float
) -> tuple[float, float, float]:
    """Stored energy [J]: kinetic, in the grip's spring, in the environment's springs."""
    environment = 0.0
    if p.spring_stiffness > 0.0:
        stretch = x - p.spring_position
        environment = 0.5 * p.spring_stiffness * stretch * stretch
    depth = p.wall_side * (x - p.wall_position)
    if depth > 0.0:
        environment = environment + 0.5 * p.wall_stiffness * depth * depth
    ahead = reference - x
    return 0.5 * p.mass * v * v, 0.5 * p.grip_stiffness * ahead * ahead, environment


def plant_forces(
    p: PlantParams, x: float, v: float, reference: float, reference_rate: float
) -> tuple[float, float]:
    """Force of the hand's grip and of the environment on the mass, positive along x."""
    hand = p.grip_stiffness * (reference - x) + p.grip_damping * (reference_rate - v)
    environment = 0.0
    if p.spring_stiffness > 0.0:
        environment = -p.spring_stiffness * (x - p.spring_position)
    depth = p.wall_side * (x - p.wall_position)
    if depth > 0.0:
        push = p.wall_stiffness * depth + p.wall_damping * p.wall_side * v
        if push > 0.0:
            environment = environment - p.wall_side * push
    return hand, environment
