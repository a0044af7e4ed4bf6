"""Solids for tests: a box, a prism with an inner edge, a ball; as triangles, and as files."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence

from tautwave_scenes.models.solid import Point, Solid, Triangle, solid_of

Shape = tuple[list[Point], list[Triangle]]


def prism(outline: Sequence[tuple[float, float]], low: float, high: float) -> Shape:
    """Return a prism over an outline that is seen counter-clockwise from its first corner."""
    count = len(outline)
    points = [(x, y, z) for z in (low, high) for x, y in outline]
    triangles: list[Triangle] = []
    for k in range(count):
        after = (k + 1) % count
        triangles += [(k, after, count + after), (k, count + after, count + k)]
    for k in range(1, count - 1):
        triangles += [(0, k + 1, k), (count, count + k, count + k + 1)]
    return points, triangles


def box(x: float, y: float, z: float) -> Shape:
    """Return a box around the origin."""
    return prism([(x, y), (-x, y), (-x, -y), (x, -y)], -z, z)


def angle() -> Shape:
    """Return an L, 40 mm long and 20 mm high, whose inner edge is at (0, 0)."""
    outline = [(0.0, 0.0), (0.0, 0.02), (-0.02, 0.02), (-0.02, -0.02), (0.02, -0.02), (0.02, 0.0)]
    return prism(outline, -0.01, 0.01)


def ball(radius: float, rings: int) -> Shape:
    """Return a ball of 2 rings^2 quadrangles, cut in two; at the poles triangles."""
    points: list[Point] = [(0.0, 0.0, radius)]
    around = 2 * rings
    for ring in range(1, rings):
        polar = math.pi * ring / rings
        for k in range(around):
            turn = 2.0 * math.pi * k / around
            flat = radius * math.sin(polar)
            x, y = flat * math.cos(turn), flat * math.sin(turn)
            points.append((x, y, radius * math.cos(polar)))
    points.append((0.0, 0.0, -radius))
    last = len(points) - 1
    triangles: list[Triangle] = []
    for k in range(around):
        after = (k + 1) % around
        triangles.append((0, 1 + k, 1 + after))
        for ring in range(rings - 2):
            a, b = 1 + ring * around, 1 + (ring + 1) * around
            triangles += [(a + k, b + k, b + after), (a + k, b + after, a + after)]
        end = 1 + (rings - 2) * around
        triangles.append((end + k, last, end + after))
    return points, triangles


def made(shape: Shape) -> Solid:
    return solid_of(*shape, "shape.stl")


def binary_stl(shape: Shape, heading: bytes = b"") -> bytes:
    points, triangles = shape
    data = heading.ljust(80) + struct.pack("<I", len(triangles))
    for one in triangles:
        data += struct.pack("<12fH", 0, 0, 0, *(part for at in one for part in points[at]), 0)
    return data


def ascii_stl(shape: Shape) -> bytes:
    points, triangles = shape
    lines = ["solid shape"]
    for one in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex " + " ".join(f"{part:.9g}" for part in points[at]) for at in one]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid shape", ""]).encode()


def obj(shape: Shape) -> bytes:
    points, triangles = shape
    lines = ["# shape", "o shape"]
    lines += ["v " + " ".join(f"{part:.9g}" for part in point) for point in points]
    lines += ["f " + " ".join(f"{at + 1}//1" for at in one) for one in triangles]
    return "\n".join([*lines, ""]).encode()
