"""Outlines of walls in space, as lines and patches to be drawn."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tautwave.laws.space.proxy import PLANES, Surface
from tautwave.report.figures.envelope import Floats

ROUND = 48
"""Corners of a drawn circle."""


class Wire(NamedTuple):
    """Lines and filled patches, each (n, 3) [m]."""

    lines: list[Floats]
    patches: list[Floats]


def wires_of(wall: Any, frame: Floats, reach: float, near: Floats) -> Wire:
    """Return the outline of a wall (its keys), in base axes; of what is endless a part.

    It is that around `near`, the middle of where the tip was, for an arm of this `reach`.
    """
    lines: list[Floats] = []
    patches: list[Floats] = []
    centre = np.array(wall.centre)
    if wall.shape == "plane":
        way = np.array(wall.normal) / np.linalg.norm(wall.normal)
        one, two = _across(way)
        size = 0.3 * reach
        middle = near @ frame.T
        middle = middle - ((middle - centre) @ way) * way
        corners = [(1, 1), (1, -1), (-1, -1), (-1, 1)]
        patches.append(np.array([middle + size * (i * one + j * two) for i, j in corners]))
    elif wall.shape == "sphere":
        lines += [_circle(centre, way, wall.radius) for way in np.eye(3)]
    elif wall.shape == "cylinder":
        way = np.array(wall.axis) / np.linalg.norm(wall.axis)
        half = 0.5 * (wall.length or 0.4 * reach)
        rings = [_circle(centre + s * half * way, way, wall.radius) for s in (-1.0, 1.0)]
        lines += rings
        lines += [np.array([rings[0][k], rings[1][k]]) for k in range(0, ROUND, ROUND // 4)]
    elif wall.shape == "mesh":
        points = np.array(wall.points)
        patches += [points[list(face)] for face in wall.triangles]
    elif wall.shape == "path":
        lines.append(np.array(wall.points))
    else:
        patches += _faces(wall.surface())
    return Wire([line @ frame for line in lines], [patch @ frame for patch in patches])


def _across(way: Floats) -> tuple[Floats, Floats]:
    one = np.cross(way, [0.0, 1.0, 0.0] if abs(way[1]) < 0.9 else [1.0, 0.0, 0.0])
    one = one / np.linalg.norm(one)
    return one, np.cross(way, one)


def _circle(centre: Floats, way: Floats, radius: float) -> Floats:
    one, two = _across(way)
    turn = np.linspace(0.0, 2.0 * np.pi, ROUND + 1)
    ring: Floats = centre + radius * (np.outer(np.cos(turn), one) + np.outer(np.sin(turn), two))
    return ring


def _faces(surface: Surface) -> list[Floats]:
    """Return the faces of a convex body: its corners are where three planes meet."""
    assert surface.kind == PLANES
    planes = np.array(surface.numbers).reshape(-1, 4)
    count = len(planes)
    corners: list[list[Floats]] = [[] for _ in range(count)]
    for i in range(count):
        for j in range(i):
            for k in range(j):
                matrix = planes[[i, j, k], :3]
                if abs(np.linalg.det(matrix)) < 1e-9:
                    continue
                corner = np.linalg.solve(matrix, planes[[i, j, k], 3])
                if np.all(planes[:, :3] @ corner <= planes[:, 3] + 1e-9):
                    for face in (i, j, k):
                        corners[face].append(corner)
    faces = []
    for face, places in enumerate(corners):
        if len(places) < 3:
            continue
        one, two = _across(planes[face, :3])
        middle = np.mean(places, axis=0)
        order = sorted(
            places,
            key=lambda p: np.arctan2((p - middle) @ two, (p - middle) @ one),
        )
        faces.append(np.array(order))
    return faces
