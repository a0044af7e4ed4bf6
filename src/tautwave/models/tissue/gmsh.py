"""Mesh files: Gmsh's format 2.2 in ASCII, of linear tetrahedra. Others are refused by name.

Source: Gmsh reference manual, legacy MSH file format version 2. Only `$MeshFormat`, `$Nodes` and
`$Elements` are read; points, lines and triangles, which mark boundaries, are skipped, as are nodes
of no tetrahedron. Tetrahedra that are numbered the other way round are righted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from tautwave.errors import ConfigError
from tautwave.models.tissue.mesh import Corners, Mesh, righted

MOST_TETRAHEDRA = 100_000
_TETRAHEDRON = 4
_SKIPPED = {1: "lines", 2: "triangles", 15: "points"}
_KINDS = {
    3: "quadrangles",
    5: "hexahedra",
    6: "prisms",
    7: "pyramids",
    8: "second-order lines",
    9: "second-order triangles",
    11: "second-order tetrahedra",
}


def gmsh_mesh(text: str, name: str) -> Mesh:
    """Return the mesh in the text of a Gmsh file, in its own unit of length.

    Raises
    ------
    ConfigError
        It has another format, or holds anything but linear tetrahedra; `name` is the file's.
    """
    sections = dict(_sections(iter(text.split("\n"))))
    head = (sections.get("MeshFormat") or [""])[0].split()
    if not head or head[0] not in ("2", "2.0", "2.1", "2.2") or head[1:2] != ["0"]:
        found = " ".join(head[:2]) or "none"
        raise ConfigError(
            f"{name} has mesh format {found}; save it from Gmsh as version 2 ASCII (2.2 0)"
        )
    try:
        return _mesh(name, sections.get("Nodes", []), sections.get("Elements", []))
    except (ValueError, IndexError, KeyError) as err:
        raise ConfigError(f"{name} is damaged: {err!r} in its nodes or elements") from err


def _sections(lines: Iterator[str]) -> Iterator[tuple[str, list[str]]]:
    for line in lines:
        if line.startswith("$") and not line.startswith("$End"):
            name = line[1:].strip()
            content = []
            for inside in lines:
                if inside.startswith("$End"):
                    break
                if inside.strip():
                    content.append(inside)
            yield name, content


def _mesh(name: str, nodes: list[str], elements: list[str]) -> Mesh:
    places = {}
    for line in nodes[1:]:
        number, x, y, z = line.split()[:4]
        place = (float(x), float(y), float(z))
        if not all(math.isfinite(part) for part in place):
            raise ConfigError(f"{name}: node {number} is not finite")
        places[int(number)] = place
    found: list[tuple[int, ...]] = []
    for line in elements[1:]:
        numbers = [int(word) for word in line.split()]
        kind = numbers[1]
        if kind == _TETRAHEDRON:
            found.append(tuple(numbers[3 + numbers[2] :][:4]))
        elif kind not in _SKIPPED:
            what = _KINDS.get(kind, f"elements of type {kind}")
            raise ConfigError(f"{name} holds {what}: only linear tetrahedra are supported")
    if not found:
        raise ConfigError(f"{name} holds no tetrahedra: mesh the volume, not its surface")
    if len(found) > MOST_TETRAHEDRA:
        raise ConfigError(f"{name} holds {len(found)} tetrahedra; {MOST_TETRAHEDRA} are the limit")
    if len(places) != int(nodes[0]) or len(elements) - 1 != int(elements[0]):
        raise ConfigError(f"{name} is cut off: it holds fewer nodes or elements than it says")
    used = sorted({number for corners in found for number in corners})
    order = {number: at for at, number in enumerate(used)}
    where = tuple(places[number] for number in used)
    tetrahedra: list[Corners] = []
    for corners in found:
        a, b, c, d = (order[number] for number in corners)
        tetrahedra.append(righted(where, (a, b, c, d)))
    return Mesh(where, tuple(tetrahedra))
