"""A solid: a closed surface of triangles, checked, and laid out for `models.surface`.

Corners at the same place are one. Triangles without an area, and those that are there twice, are
left out and counted. What is left has to be closed, turned the same way round everywhere, and to
have its inside inside: only then is there a depth. That it does not cross itself is not checked.
"""

from __future__ import annotations

import math
from typing import NamedTuple, Sequence  # noqa: UP035 - models import arithmetic only

Point = tuple[float, float, float]
Triangle = tuple[int, int, int]

MAX_TRIANGLES = 50_000
"""More take too long to check; a hand feels no difference."""

_FLAT = 1e-12
"""A triangle whose area is a smaller share of its longest edge's square has none."""


class Solid(NamedTuple):
    """A closed surface.

    `points` [m]; `triangles` of them, counter-clockwise seen from outside; how many triangles of
    the file had no area (`flat`) or were there already (`doubled`), and are left out.
    """

    points: tuple[Point, ...]
    triangles: tuple[Triangle, ...]
    flat: int = 0
    doubled: int = 0


class Laid(NamedTuple):
    """A solid laid out for `models.surface`; nodes and triangles are numbered from 0."""

    tree: list[int]
    boxes: list[float]
    faces: list[float]


def solid_of(points: Sequence[Point], triangles: Sequence[Triangle], name: str) -> Solid:
    """Return the solid that triangles enclose; `name` is that of their file.

    Raises
    ------
    ValueError
        They are too many, not finite, not closed, or turned inside out.
    """
    check_count(len(triangles), name)
    at: dict[Point, int] = {}
    places: list[int] = []
    for number, point in enumerate(points):
        if not all(math.isfinite(part) for part in point):
            raise ValueError(f"{name}: corner {number + 1} is not finite: {point}")
        x, y, z = point
        places.append(at.setdefault((x + 0.0, y + 0.0, z + 0.0), len(at)))  # -0.0 is 0.0
    welded = list(at)
    kept: list[Triangle] = []
    known: set[Triangle] = set()
    flat = doubled = 0
    for triangle in triangles:
        a, b, c = (places[corner] for corner in triangle)
        if _is_flat(welded[a], welded[b], welded[c]):
            flat += 1
            continue
        least = min(a, b, c)
        turned = (a, b, c) if a == least else (b, c, a) if b == least else (c, a, b)
        if turned in known:
            doubled += 1
            continue
        known.add(turned)
        kept.append(turned)
    if not kept:
        raise ValueError(f"{name} has no triangle with an area")
    _check_closed(welded, kept, name, flat)
    if _volume(welded, kept) < 0.0:
        raise ValueError(
            f"{name} is inside out: all its triangles face inwards; flip its normals "
            "(in MeshLab: Invert Faces Orientation)"
        )
    return Solid(tuple(welded), tuple(kept), flat, doubled)


def check_count(count: int, name: str) -> None:
    """Refuse a file without triangles, or with too many of them."""
    if count > MAX_TRIANGLES:
        raise ValueError(
            f"{name} has {count} triangles; {MAX_TRIANGLES} are the limit: simplify it "
            "(in MeshLab: Quadric Edge Collapse Decimation)"
        )
    if count == 0:
        raise ValueError(f"{name} holds no triangles")


def _is_flat(a: Point, b: Point, c: Point) -> bool:
    normal = _cross(_minus(b, a), _minus(c, a))
    longest = max(_dot(e, e) for e in (_minus(b, a), _minus(c, b), _minus(a, c)))
    return not math.sqrt(_dot(normal, normal)) > _FLAT * longest


def _check_closed(
    points: Sequence[Point], triangles: Sequence[Triangle], name: str, flat: int
) -> None:
    """Refuse edges that do not lie between exactly two triangles turned the same way round."""
    edges: dict[tuple[int, int], int] = {}
    for number, (a, b, c) in enumerate(triangles):
        for edge in ((a, b), (b, c), (c, a)):
            if edge in edges:
                what = (
                    f"triangles {edges[edge] + 1} and {number + 1}"
                    if flat == 0
                    else "two of its triangles"
                )
                where = _text(points[edge[0]])
                raise ValueError(
                    f"{name} has a flipped triangle, or an edge of more than two: {what} run along "
                    f"the same edge in the same direction at {where}; repair it (in MeshLab: "
                    "Re-Orient all faces coherently)"
                )
            edges[edge] = number
    open_edges = [edge for edge in edges if (edge[1], edge[0]) not in edges]
    if open_edges:
        where = _text(points[open_edges[0][0]])
        raise ValueError(
            f"{name} is not closed: {len(open_edges)} edges have a triangle on one side only, "
            f"the first at {where}; a wall needs an inside (in MeshLab: Close Holes, after Merge "
            "Close Vertices)"
        )


def solid_size(solid: Solid) -> list[float]:
    """Return how long a solid is along x, y and z [m]."""
    return [max(part) - min(part) for part in zip(*solid.points, strict=True)]


def volume_of(solid: Solid) -> float:
    """Return what a solid encloses [m^3]."""
    return _volume(solid.points, solid.triangles)


def _volume(points: Sequence[Point], triangles: Sequence[Triangle]) -> float:
    middle = points[triangles[0][0]]
    total = 0.0
    for corners in triangles:
        a, b, c = (_minus(points[corner], middle) for corner in corners)
        total += _dot(a, _cross(b, c))
    return total / 6.0


def laid_out(solid: Solid) -> Laid:
    """Return tree, boxes and triangles of a solid; the order of its triangles is the tree's."""
    corners = [tuple(solid.points[at] for at in one) for one in solid.triangles]
    middles = [tuple(sum(corner[c] for corner in one) / 3.0 for c in range(3)) for one in corners]
    tree: list[int] = []
    boxes: list[float] = []
    waiting: list[list[int] | int] = [list(range(len(corners)))]
    while waiting:
        some = waiting.pop()
        if isinstance(some, int):
            tree[2 * some] = len(tree) // 2
            continue
        node = len(tree) // 2
        low = [min(corner[c] for at in some for corner in corners[at]) for c in range(3)]
        high = [max(corner[c] for at in some for corner in corners[at]) for c in range(3)]
        boxes += [low[0], high[0], low[1], high[1], low[2], high[2]]
        if len(some) == 1:
            tree += [node + 1, some[0]]
            continue
        tree += [0, -1]
        size = [high[c] - low[c] for c in range(3)]
        axis = size.index(max(size))
        order = sorted(some, key=lambda at: (middles[at][axis], at))
        half = len(order) // 2
        waiting += [node, order[half:], order[:half]]
    return Laid(tree, boxes, _faces(solid))


def _faces(solid: Solid) -> list[float]:
    """Return corners and pseudo-normals of all triangles."""
    of_edge: dict[tuple[int, int], Point] = {}
    of_corner: dict[int, list[float]] = {}
    normals = []
    for one in solid.triangles:
        a, b, c = (solid.points[at] for at in one)
        normal = _unit(_cross(_minus(b, a), _minus(c, a)))
        normals.append(normal)
        for k in range(3):
            of_edge[one[k], one[(k + 1) % 3]] = normal
            here = solid.points[one[k]]
            to, back = (_minus(solid.points[one[(k + j) % 3]], here) for j in (1, 2))
            angle = math.atan2(math.sqrt(_dot(_cross(to, back), _cross(to, back))), _dot(to, back))
            total = of_corner.setdefault(one[k], [0.0, 0.0, 0.0])
            for axis in range(3):
                total[axis] += angle * normal[axis]
    faces: list[float] = []
    for one, normal in zip(solid.triangles, normals, strict=True):
        for at in one:
            faces += solid.points[at]
        faces += normal
        for k in range(3):
            other = of_edge[one[(k + 1) % 3], one[k]]
            x, y, z = (p + q for p, q in zip(normal, other, strict=True))
            faces += _unit((x, y, z))
        for at in one:
            x, y, z = of_corner[at]
            faces += _unit((x, y, z))
    return faces


def _minus(a: Point, b: Point) -> Point:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def _cross(a: Point, b: Point) -> Point:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _dot(a: Point, b: Point) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(a: Point) -> Point:
    size = math.sqrt(_dot(a, a))
    return (a[0] / size, a[1] / size, a[2] / size) if size > 0.0 else (0.0, 0.0, 0.0)


def _text(point: Point) -> str:
    return f"({point[0]:.4g}, {point[1]:.4g}, {point[2]:.4g})"


def placed_solid(solid: Solid, scale: float, turn: Point, position: Point) -> Solid:
    """Return a solid in a scene: scaled, turned by a rotation vector [rad], and moved [m]."""
    angle = math.sqrt(_dot(turn, turn))
    way = _unit(turn)
    cos, sin = math.cos(angle), math.sin(angle)
    points = []
    for x, y, z in solid.points:
        own = (scale * x, scale * y, scale * z)
        along, across = (1.0 - cos) * _dot(way, own), _cross(way, own)
        points.append(
            (
                cos * own[0] + sin * across[0] + along * way[0] + position[0],
                cos * own[1] + sin * across[1] + along * way[1] + position[1],
                cos * own[2] + sin * across[2] + along * way[2] + position[2],
            )
        )
    return solid._replace(points=tuple(points))
