"""Edges of a contact and of friction, where the motion changes its law; SI of the axis."""

from __future__ import annotations

from tautwave.models.foam import FoamParams, elastic_force

FREE = 0
PRESSING = 1
CLIPPED = 2


def release_level(foam: FoamParams, depth: float, speed: float) -> float:
    """Return what is above zero while a contact at `depth` pushes; `speed` is into it [SI]."""
    if foam.damping > 0.0:
        return elastic_force(foam, depth) * (1.0 + foam.loss * speed) + foam.damping * speed
    return 1.0 + foam.loss * speed


def contact_now(foam: FoamParams, depth: float, speed: float) -> int:
    """Return FREE, PRESSING or CLIPPED at a depth and a speed into the contact [SI]."""
    if depth < 0.0 or (depth == 0.0 and not speed > 0.0):
        return FREE
    if release_level(foam, depth, speed) < 0.0:
        return CLIPPED
    return PRESSING


def edge_level(
    foam: FoamParams, contact: int, direction: float, edge: int, x: float, v: float
) -> float:
    """Return what is below zero until the motion reaches an edge [SI].

    Edge 0 is the surface, 1 where the contact begins or ends to push, 2 a stop of the friction.
    """
    if edge == 2:
        return -direction * v
    depth = foam.side * (x - foam.position)
    if edge == 0:
        if contact == FREE:
            return depth
        return -depth
    level = release_level(foam, depth, foam.side * v)
    if contact == CLIPPED:
        return level
    return -level
