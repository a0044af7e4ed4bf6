"""Signed distance to a closed surface of triangles, and its direction.

Outside it is positive. The nearest of all triangles is found in a tree of boxes, written so that it
is walked without a stack; the one that was nearest before comes first, so that most boxes are
skipped. The sign is that of the pseudo-normal of the nearest face, edge or corner.

Sources: Ericson, Real-Time Collision Detection, 2005, section 5.1.5 (the nearest point of a
triangle); Baerentzen & Aanaes 2005 (pseudo-normals and the sign).
"""

from __future__ import annotations

import math
from typing import Any

NODE = 2
"""Ints of a node in the tree: where to go on if its box is too far, and its triangle, else -1."""

BOX = 6
"""Floats of a node's box [m]: least and greatest x, y and z."""

FACE = 30
"""Floats of a triangle: three corners [m], then unit pseudo-normals: face, edges, corners.

The edges are AB, BC and CA.
"""

_TOUCHING = 1e-10
"""[m] Nearer than this the direction is the pseudo-normal: the way to the surface is rounding."""


def beside_box(boxes: Any, node: int, x: float, y: float, z: float) -> float:
    """Return the square of the distance of a point from a node's box [m^2], 0 inside."""
    at = BOX * node
    gap = 0.0
    square = 0.0
    if x < boxes[at]:
        gap = boxes[at] - x
        square = gap * gap
    elif x > boxes[at + 1]:
        gap = x - boxes[at + 1]
        square = gap * gap
    if y < boxes[at + 2]:
        gap = boxes[at + 2] - y
        square = square + gap * gap
    elif y > boxes[at + 3]:
        gap = y - boxes[at + 3]
        square = square + gap * gap
    if z < boxes[at + 4]:
        gap = boxes[at + 4] - z
        square = square + gap * gap
    elif z > boxes[at + 5]:
        gap = z - boxes[at + 5]
        square = square + gap * gap
    return square


def on_triangle(
    faces: Any, at: int, x: float, y: float, z: float
) -> tuple[float, float, float, float, int]:
    """Return how far a point is from a triangle, squared [m^2], the way from there, and the part.

    The way leads from the nearest point to the point given; parts are numbered as pseudo-normals
    are in `faces`, where the triangle begins at `at`.
    """
    ax = faces[at]
    ay = faces[at + 1]
    az = faces[at + 2]
    ux = faces[at + 3] - ax
    uy = faces[at + 4] - ay
    uz = faces[at + 5] - az
    wx = faces[at + 6] - ax
    wy = faces[at + 7] - ay
    wz = faces[at + 8] - az
    px = x - ax
    py = y - ay
    pz = z - az
    d1 = ux * px + uy * py + uz * pz
    d2 = wx * px + wy * py + wz * pz
    part = 0
    v = 0.0
    w = 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        part = 4
    else:
        uu = ux * ux + uy * uy + uz * uz
        uw = ux * wx + uy * wy + uz * wz
        ww = wx * wx + wy * wy + wz * wz
        d3 = d1 - uu
        d4 = d2 - uw
        d5 = d1 - uw
        d6 = d2 - ww
        if d3 >= 0.0 and d4 <= d3:
            part = 5
            v = 1.0
        elif d6 >= 0.0 and d5 <= d6:
            part = 6
            w = 1.0
        else:
            vc = d1 * d4 - d3 * d2
            vb = d5 * d2 - d1 * d6
            va = d3 * d6 - d5 * d4
            if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
                part = 1
                v = d1 / (d1 - d3)
            elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
                part = 3
                w = d2 / (d2 - d6)
            elif va <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
                part = 2
                w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
                v = 1.0 - w
            else:
                whole = 1.0 / (va + vb + vc)
                v = vb * whole
                w = vc * whole
    gx = px - v * ux - w * wx
    gy = py - v * uy - w * wy
    gz = pz - v * uz - w * wz
    return gx * gx + gy * gy + gz * gz, gx, gy, gz, part


def surface_of(
    tree: Any, boxes: Any, faces: Any, first: int, end: int, guess: int,
    x: float, y: float, z: float,
) -> tuple[float, float, float, float, int]:  # fmt: skip
    """Return the signed distance of a point from a closed surface, its direction, the triangle.

    Parameters
    ----------
    tree, boxes, faces : ints, floats, floats
        As `models.solid` lays them out.
    first, end : int
        Its nodes in the tree.
    guess : int
        A triangle of it, best one near the point.
    x, y, z : float
        The point [m].
    """
    best = guess
    square, gx, gy, gz, part = on_triangle(faces, FACE * best, x, y, z)
    node = first
    while node < end:
        if beside_box(boxes, node, x, y, z) >= square:
            node = tree[NODE * node]
            continue
        triangle = tree[NODE * node + 1]
        if triangle >= 0 and triangle != best:
            less, hx, hy, hz, other = on_triangle(faces, FACE * triangle, x, y, z)
            if less < square:
                square = less
                gx = hx
                gy = hy
                gz = hz
                part = other
                best = triangle
        node = node + 1
    at = FACE * best + 9 + 3 * part
    nx = faces[at]
    ny = faces[at + 1]
    nz = faces[at + 2]
    along = gx * nx + gy * ny + gz * nz
    far = math.sqrt(square)
    if far < _TOUCHING:
        return along, nx, ny, nz, best
    if along < 0.0:
        far = -far
    return far, gx / far, gy / far, gz / far, best
