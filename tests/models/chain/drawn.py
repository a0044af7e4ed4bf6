"""Random serial chains, and the same ones for Pinocchio."""

from __future__ import annotations

import math
import random
from typing import Any

from tautwave.models.chain.build import Body, Link, Matrix, Vector, roll_pitch_yaw

RIGHT = (0.0, math.pi / 2, math.pi, -math.pi / 2, 1.5708)
AXES: tuple[Vector, ...] = ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.0, -1.0, 0.0))


def draw_chain(rng: random.Random, joints: int) -> tuple[Link, ...]:
    """Return links of which `joints` move; parallel axes and right angles are frequent."""
    links: list[Link] = []
    moving = 0
    while moving < joints:
        kind = rng.choice(("turns", "turns", "turns", "slides", "fixed"))
        links.append(_link(rng, f"j{len(links)}", kind))
        moving += kind != "fixed"
    if rng.random() < 0.5:
        links.append(_link(rng, "flange", "fixed"))
    return tuple(links)


def draw_body(rng: random.Random) -> Body:
    """Return a body of some hundred grams to two kilograms."""
    rows = [[rng.gauss(0.0, 0.1) for _ in range(3)] for _ in range(3)]
    inertia = [[sum(a * b for a, b in zip(p, q, strict=True)) for q in rows] for p in rows]
    for i in range(3):
        inertia[i][i] += 1e-3
    matrix: Any = tuple(map(tuple, inertia))
    centre: Any = tuple(rng.uniform(-0.2, 0.2) for _ in range(3))
    return Body(rng.uniform(0.1, 2.0), centre, matrix)


def _link(rng: random.Random, name: str, kind: str) -> Link:
    place: Any = tuple(rng.uniform(-0.5, 0.5) for _ in range(3))
    angles = [rng.choice(RIGHT) for _ in range(3)]
    if rng.random() < 0.7:
        angles = [rng.uniform(-3.0, 3.0) for _ in range(3)]
    turn: Matrix = roll_pitch_yaw(*angles)
    axis = rng.choice(AXES)
    if rng.random() < 0.3:
        x, y, z = (rng.gauss(0.0, 1.0) for _ in range(3))
        size = math.hypot(x, y, z)
        axis = (x / size, y / size, z / size)
    return Link(name, kind, place, turn, axis, draw_body(rng))


def pin_model(
    pin: Any,
    links: tuple[Link, ...],
    gravity: Vector,
    tip: Body = Body(),  # noqa: B008  a constant
) -> tuple[Any, int]:
    """Return Pinocchio's model of a chain that holds a body, and the number of its tip's frame."""
    import numpy as np

    model = pin.Model()
    model.gravity.linear = np.array(gravity)
    parent, place = 0, pin.SE3.Identity()
    for link in links:
        place = place * pin.SE3(np.array(link.turn), np.array(link.place))
        body = link.body
        inertia = pin.Inertia(body.mass, np.array(body.centre), np.array(body.inertia))
        if link.kind == "fixed":
            if parent:
                model.appendBodyToJoint(parent, inertia, place)
            continue
        kinds = {
            "turns": pin.JointModelRevoluteUnaligned,
            "slides": pin.JointModelPrismaticUnaligned,
        }
        joint = kinds[link.kind](np.array(link.axis))
        parent = model.addJoint(parent, joint, place, link.name)
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        place = pin.SE3.Identity()
    if tip.mass > 0.0:
        held = pin.Inertia(tip.mass, np.array(tip.centre), np.array(tip.inertia))
        model.appendBodyToJoint(parent, held, place)
    frame = pin.Frame("tip", parent, place, pin.FrameType.OP_FRAME)
    return model, model.addFrame(frame)
