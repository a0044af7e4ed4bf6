"""Meshes of tetrahedra as plain data: blocks of cells, nodes on a face, a tetrahedron's shape."""

from __future__ import annotations

import math
from typing import Iterable, NamedTuple, Sequence  # noqa: UP035 - models import arithmetic only

from tautwave_scenes.models.tissue.algebra import Vector

MAX_TETRAHEDRA = 100_000
FACES = ("-x", "+x", "-y", "+y", "-z", "+z")
Corners = tuple[int, int, int, int]

CELL = 5
"""Tetrahedra of a cell of a block."""

_EVEN = (
    ((0, 0, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)),
    ((1, 0, 0), (0, 0, 0), (1, 1, 0), (1, 0, 1)),
    ((0, 1, 0), (0, 0, 0), (1, 1, 0), (0, 1, 1)),
    ((0, 0, 1), (0, 0, 0), (1, 0, 1), (0, 1, 1)),
    ((1, 1, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)),
)


class Mesh(NamedTuple):
    """Nodes [m], and tetrahedra as four numbers of nodes each, of positive volume.

    `groups` are numbers of nodes by the name that the file has for them, `bodies` numbers of
    tetrahedra, of groups that have some.
    """

    nodes: tuple[Vector, ...]
    tetrahedra: tuple[Corners, ...]
    groups: tuple[tuple[str, tuple[int, ...]], ...] = ()
    bodies: tuple[tuple[str, tuple[int, ...]], ...] = ()


def block(size: Vector, cells: tuple[int, int, int], corner: Vector = (0.0, 0.0, 0.0)) -> Mesh:
    """Return a box cut into cells of five tetrahedra, mirrored from cell to cell.

    Parameters
    ----------
    size : Vector
        Its edges along x, y and z [m].
    cells : (int, int, int)
        How many along each; nodes are numbered along x, then y, then z.
    corner : Vector
        Its corner of least x, y and z [m].
    """
    across, down, high = (count + 1 for count in cells)
    steps = [length / count for length, count in zip(size, cells, strict=True)]
    nodes = tuple(
        (
            corner[0] + i * steps[0],
            corner[1] + j * steps[1],
            corner[2] + k * steps[2],
        )
        for k in range(high)
        for j in range(down)
        for i in range(across)
    )
    tetrahedra: list[Corners] = []
    for number in range(cells[0] * cells[1] * cells[2]):
        rest, i = divmod(number, cells[0])
        k, j = divmod(rest, cells[1])
        odd = (i + j + k) % 2
        for corners in _EVEN:
            # Mirrored along x in every other cell, so that the diagonals of faces meet.
            places = [(i + (a ^ odd), j + b, k + c) for a, b, c in corners]
            numbers = [a + across * (b + down * c) for a, b, c in places]
            tetrahedra.append(righted(nodes, (numbers[0], numbers[1], numbers[2], numbers[3])))
    return Mesh(nodes, tuple(tetrahedra))


def placed(mesh: Mesh, scale: float, position: Vector) -> Mesh:
    """Return a mesh `scale` times as large, with its origin at `position` [m]."""
    x, y, z = position
    nodes = tuple((x + scale * a, y + scale * b, z + scale * c) for a, b, c in mesh.nodes)
    return mesh._replace(nodes=nodes)


def righted(nodes: tuple[Vector, ...], corners: Corners) -> Corners:
    """Return a tetrahedron's corners in an order of positive volume."""
    a, b, c, d = (nodes[number] for number in corners)
    one, two, three = ([q - p for p, q in zip(a, end, strict=True)] for end in (b, c, d))
    volume = sum(one[i] * (two[i - 2] * three[i - 1] - two[i - 1] * three[i - 2]) for i in range(3))
    return corners if volume > 0.0 else (corners[0], corners[2], corners[1], corners[3])


def doubled_face(tetrahedra: Sequence[Corners]) -> tuple[int, ...] | None:
    """Return the nodes of a face that has two tetrahedra on the same side, None without one.

    Of a body's tetrahedra, all of positive volume, each face has one on either side: two on the
    same overlap, or are the same one twice.
    """
    seen: set[tuple[int, ...]] = set()
    for a, b, c, d in tetrahedra:
        for face in ((a, c, b), (a, b, d), (a, d, c), (b, c, d)):
            first = face.index(min(face))
            turned = face[first:] + face[:first]
            if turned in seen:
                return turned
            seen.add(turned)
    return None


def on_faces(mesh: Mesh, faces: Iterable[str]) -> set[int]:
    """Return the numbers of the nodes on faces of the box around a mesh, or of its groups.

    Parameters
    ----------
    mesh : Mesh
    faces : iterable of str
        One of `FACES` each, or the name of a group; a name that is neither has no nodes.
    """
    numbers: set[int] = set()
    groups = dict(mesh.groups)
    for face in faces:
        if face not in FACES:
            numbers |= set(groups.get(face, ()))
            continue
        c = "xyz".index(face[1])
        places = [node[c] for node in mesh.nodes]
        low, high = min(places), max(places)
        edge = low if face[0] == "-" else high
        near = 1e-6 * (high - low)
        numbers |= {number for number, place in enumerate(places) if abs(place - edge) <= near}
    return numbers


LONGEST = 1e6
"""[m] Greatest edge of a tetrahedron."""

THIN = 1e-4
"""Six volumes over the cube of the longest edge below which a tetrahedron counts as flat."""


def shape_of(corners: Sequence[Vector], name: str) -> tuple[tuple[float, ...], float]:
    """Return the gradients of a tetrahedron's shape functions 1 to 3 [1/m], and its volume [m^3].

    Raises
    ------
    ValueError
        It is flat, inverted (its corners are numbered the other way round) or not finite.
    """
    start = corners[0]
    one, two, three = (
        [end - begin for end, begin in zip(corner, start, strict=True)] for corner in corners[1:]
    )
    if not all(math.isfinite(part) for corner in corners for part in corner):
        raise ValueError(f"{name}: its corners are not all finite numbers")
    longest = max(math.dist(a, b) for a in corners for b in corners)
    if longest > LONGEST:
        raise ValueError(f"{name}: its longest edge is {longest:.3g} m; check the mesh's scale")
    across = (_cross(two, three), _cross(three, one), _cross(one, two))
    six = sum(p * q for p, q in zip(one, across[0], strict=True))
    if not abs(six) > THIN * longest**3:
        raise ValueError(
            f"{name}: it is flat (volume {six / 6.0:.3g} m^3, longest edge {longest:.3g} m); "
            "mesh the part again without slivers"
        )
    if six < 0.0:
        raise ValueError(f"{name}: it is inverted; swap two of its corners")
    return tuple(part / six for vector in across for part in vector), six / 6.0


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
