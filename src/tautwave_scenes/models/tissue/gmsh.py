"""Mesh files: Gmsh's format 2.2 in ASCII, of linear tetrahedra. Others are refused by name.

Source: Gmsh reference manual, legacy MSH file format version 2. `$MeshFormat`, `$PhysicalNames`,
`$Nodes` and `$Elements` are read; points, lines and triangles say which nodes a physical group has.
Nodes of no tetrahedron are left out. Tetrahedra that are numbered the other way round are righted.
"""

from __future__ import annotations

import math
from typing import Iterable, Iterator, Mapping, NamedTuple, Sequence  # noqa: UP035 - models import arithmetic only

from tautwave_scenes.models.tissue.mesh import MAX_TETRAHEDRA, Corners, Mesh, doubled_face, righted

_TETRAHEDRON = 4
_SKIPPED = {1: "lines", 2: "triangles", 15: "points"}
_DIMENSIONS = {15: 0, 1: 1, 2: 2, _TETRAHEDRON: 3}
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
    ValueError
        It has another format, or holds anything but linear tetrahedra; `name` is the file's.
    """
    sections = dict(_sections(iter(text.split("\n"))))
    head = (sections.get("MeshFormat") or [""])[0].split()
    if not head or head[0] not in ("2", "2.0", "2.1", "2.2") or head[1:2] != ["0"]:
        version = " ".join(head[:2]) or "none"
        raise ValueError(
            f"{name} has mesh format {version}; save it from Gmsh as version 2 ASCII (2.2 0)"
        )
    parts = _parts(name, sections.get("Nodes", []), sections.get("Elements", []))
    groups: dict[str, set[int]] = {}
    for key, nodes in parts.groups.items():  # without names two dimensions may have one number
        groups.setdefault(_name(sections, key), set()).update(nodes)
    bodies = {_name(sections, (3, number)): members for number, members in parts.bodies.items()}
    return numbered_mesh(name, parts.places, parts.tetrahedra, groups, bodies)


def _name(sections: dict[str, list[str]], key: tuple[int, int]) -> str:
    """Return the name of a physical group, of a dimension and a number; the number without one."""
    for line in sections.get("PhysicalNames", [])[1:]:
        words = line.split(maxsplit=2)
        if len(words) == 3 and words[:2] == [str(key[0]), str(key[1])]:
            return words[2].strip().strip('"')
    return str(key[1])


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


class _Parts(NamedTuple):
    """Nodes by their number, the nodes of each tetrahedron, and of each physical group.

    A group has the dimension and the number of Gmsh; `bodies` are the places of the tetrahedra of
    those of dimension 3, by number.
    """

    places: dict[int, tuple[float, float, float]]
    tetrahedra: list[tuple[int, ...]]
    groups: dict[tuple[int, int], set[int]]
    bodies: dict[int, list[int]]


def _parts(name: str, nodes: list[str], elements: list[str]) -> _Parts:
    """Return what two sections say; elements of other kinds are refused."""
    places = {}
    tetrahedra: list[tuple[int, ...]] = []
    strange: list[int] = []
    groups: dict[tuple[int, int], set[int]] = {}
    bodies: dict[int, list[int]] = {}
    try:
        for line in nodes[1:]:
            number, x, y, z = line.split()[:4]
            places[int(number)] = (float(x), float(y), float(z))
        for line in elements[1:]:
            numbers = [int(word) for word in line.split()]
            corners = numbers[3 + numbers[2] :]
            if numbers[1] == _TETRAHEDRON:
                a, b, c, d = corners
                if numbers[2] and numbers[3]:
                    bodies.setdefault(numbers[3], []).append(len(tetrahedra))
                tetrahedra.append((a, b, c, d))
            elif numbers[1] not in _SKIPPED:
                strange.append(numbers[1])
            if numbers[2] and numbers[3] and numbers[1] in _DIMENSIONS:
                group = groups.setdefault((_DIMENSIONS[numbers[1]], numbers[3]), set())
                group.update(corners)
        whole = len(places) == int(nodes[0]) and len(elements) - 1 == int(elements[0])
    except (ValueError, IndexError) as err:
        raise ValueError(f"{name} is damaged: {err} in its nodes or elements") from err
    for kind in strange:
        what = _KINDS.get(kind, f"elements of type {kind}")
        raise ValueError(f"{name} holds {what}: only linear tetrahedra are supported")
    if not whole:
        raise ValueError(f"{name} is truncated: it holds fewer nodes or elements than it declares")
    return _Parts(places, tetrahedra, groups, bodies)


def numbered_mesh(
    name: str,
    places: dict[int, tuple[float, float, float]],
    found: Sequence[tuple[int, ...]],
    groups: Mapping[str, Iterable[int]],
    bodies: Mapping[str, Iterable[int]],
) -> Mesh:
    """Return the mesh of tetrahedra, numbered anew, without nodes that none has.

    A tetrahedron of several physical groups, which Gmsh writes once for each, is there once.

    Parameters
    ----------
    name : str
        Of the file.
    places : dict
        Place of each node, in the file's unit of length.
    found : sequence
        Four nodes of each tetrahedron.
    groups : mapping
        Nodes of each physical group.
    bodies : mapping
        Places in `found` of each physical group's tetrahedra.

    Raises
    ------
    ValueError
        There are none or too many, one has an unknown node, two overlap, or a node is not finite.
    """
    for number, place in places.items():
        if not all(math.isfinite(part) for part in place):
            raise ValueError(f"{name}: node {number} is not finite")
    if not found:
        raise ValueError(f"{name} holds no tetrahedra: mesh the volume, not its surface")
    if len(found) > MAX_TETRAHEDRA:
        raise ValueError(f"{name} holds {len(found)} tetrahedra; {MAX_TETRAHEDRA} are the limit")
    used = sorted({number for corners in found for number in corners})
    missing = [number for number in used if number not in places]
    if missing:
        raise ValueError(f"{name} is damaged: a tetrahedron has the unknown node {missing[0]}")
    found, held = _once(found, bodies)
    order = {number: at for at, number in enumerate(used)}
    where = tuple(places[number] for number in used)
    tetrahedra: list[Corners] = []
    for corners in found:
        a, b, c, d = (order[number] for number in corners)
        tetrahedra.append(righted(where, (a, b, c, d)))
    twice = doubled_face(tetrahedra)
    if twice is not None:
        numbers = ", ".join(str(used[at]) for at in twice)
        raise ValueError(
            f"{name}: two tetrahedra lie on the same side of the face of nodes {numbers}: they "
            "overlap, or one is there twice; mesh the part again"
        )
    kept = {
        group: tuple(sorted(order[node] for node in nodes if node in order))
        for group, nodes in groups.items()
    }
    return Mesh(where, tuple(tetrahedra), tuple(sorted(kept.items())), tuple(sorted(held.items())))


def _once(
    found: Sequence[tuple[int, ...]], bodies: Mapping[str, Iterable[int]]
) -> tuple[list[tuple[int, ...]], dict[str, tuple[int, ...]]]:
    """Return tetrahedra without those that are there again for another group, and the groups'."""
    of: list[set[str]] = [set() for _ in found]
    for group, places in bodies.items():
        for at in places:
            of[at].add(group)
    first: dict[frozenset[int], int] = {}
    kept: list[tuple[int, ...]] = []
    named: list[set[str]] = []
    for corners, names in zip(found, of, strict=True):
        at = first.setdefault(frozenset(corners), len(kept))
        if at < len(kept) and names and named[at] and not names & named[at]:
            named[at] |= names
            continue
        kept.append(corners)
        named.append(set(names))
    held = {
        group: tuple(at for at, names in enumerate(named) if group in names) for group in bodies
    }
    return kept, held
