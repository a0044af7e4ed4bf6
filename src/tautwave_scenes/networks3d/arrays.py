"""From a network of points to flat arrays: nodes are masses, then ports, then grounds.

Coordinates of node i are at 3 i, 3 i + 1, 3 i + 2. Links are sorted by law, contacts first. The
same arrays are lists of floats live and NumPy arrays in compiled code (`simulation`).
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from itertools import accumulate, permutations
from typing import Any, NamedTuple

from tautwave_scenes.models.solid import Solid, laid_out
from tautwave_scenes.models.surface import FACE, NODE, surface_of
from tautwave_scenes.networks.compiling import connected, link_fields, ordered_links
from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks3d.elements import ELEMENT_INDICES, Elements, lay_elements
from tautwave_scenes.networks3d.network import ORIGIN, Network3d, Vector, unit

Numbers = Any
"""A list of floats (live) or a float64 array (compiled); ints in the index arrays."""

ROWS = 12
"""Rows of scratch, 3 n numbers each; see `solving`."""


class Arrays3d(NamedTuple):
    """A network of points and its state.

    Sizes: n masses, p ports, q axes, N nodes, l links. `count` is (n, p, l, q). Constant: as in
    `networks.compiling.Arrays`, `weight` (3 n); `flat` (l) is 1 where a link acts along its
    `normal` (3 l); `links_first` (n + p + 1) and `links_of` are of masses and ports; `islands`
    and `island_first`: masses to be solved together; `axis_port`, `axis_way` (3 q), `origin` (3 p).
    A link with a solid has its number, from 2 on, in `flat`; `roots` says for each its first node,
    the node after its last, its first triangle, in `tree`, `boxes` and `faces` of all solids, which
    are those of `models.surface`. `near` (l) is the triangle that was nearest last.

    State: `x`, `v`, `force` (3 N), `pushed` (3 n); of each link `tension`, its elastic share
    `elastic`, `stretch`, `way` and `apart` (3 l: direction of the pull, and vector from b to a),
    `set_in`, and of its derivative `bend` (3 l) and `side`. Books [J] as in one dimension.
    `elements` are the tetrahedra of tissue between the nodes.
    """

    count: Numbers
    mass: Numbers
    mobility: Numbers
    drag: Numbers
    weight: Numbers
    kind: Numbers
    a: Numbers
    b: Numbers
    flat: Numbers
    normal: Numbers
    k: Numbers
    z: Numbers
    rest: Numbers
    e: Numbers
    loss: Numbers
    limit: Numbers
    scale: Numbers
    links_first: Numbers
    links_of: Numbers
    islands: Numbers
    island_first: Numbers
    axis_port: Numbers
    axis_way: Numbers
    origin: Numbers
    x: Numbers
    v: Numbers
    force: Numbers
    pushed: Numbers
    tension: Numbers
    elastic: Numbers
    stretch: Numbers
    way: Numbers
    apart: Numbers
    set_in: Numbers
    bend: Numbers
    side: Numbers
    stored: Numbers
    lost: Numbers
    made: Numbers
    numeric: Numbers
    dragged: Numbers
    pumped: Numbers
    mass_numeric: Numbers
    port_work: Numbers
    work: Numbers
    roots: Numbers
    tree: Numbers
    boxes: Numbers
    faces: Numbers
    near: Numbers
    elements: Elements


INDEX_FIELDS = (
    *("count", "kind", "a", "b", "flat", "links_first", "links_of"),
    *("islands", "island_first", "axis_port"),
    *("roots", "tree", "near"),
    *ELEMENT_INDICES,
)


class Compiled3d(NamedTuple):
    """Arrays of a network, and the names behind the indices; `links` in the order of the arrays.

    `tissues` is the tissue of each element.
    """

    arrays: Arrays3d
    masses: tuple[str, ...]
    links: tuple[str, ...]
    tissues: tuple[str, ...]


def compile_network3d(network: Network3d, axes_at: Sequence[float] = ()) -> Compiled3d:
    """Return a network as lists, in its initial state; identical parallel links joined.

    Parameters
    ----------
    network : Network3d
        Its nodes and links as `config.checks.scene3d` wants them.
    axes_at : sequence of float
        Positions of the ports' axes [m]; 0 if not given.
    """
    count = len(network.masses)
    names = [mass.name for mass in network.masses]
    names += [port.name for port in network.ports]
    names += [name for name, _ in network.grounds]
    at = {name: index for index, name in enumerate(names)}
    axis_port = [number for number, port in enumerate(network.ports) for _ in port.axes]
    ways = [
        unit(way)
        for port in network.ports
        for way, _ in zip(port.directions, port.axes, strict=False)
    ]
    places = port_places(network, axes_at or [0.0] * len(axis_port))
    x = _flat([mass.position for mass in network.masses])
    x += _flat(places) + _flat([where for _, where in network.grounds])
    links = ordered_links(network.links)
    ends = [(at[link.a], at[link.b]) for link in links]
    nodes = count + len(network.ports)
    of_node: list[list[int]] = [[] for _ in range(nodes)]
    near: list[list[int]] = [[] for _ in range(count)]
    for index, (one, two) in enumerate(ends):
        for here, there in ((one, two), (two, one)):
            if here < nodes:
                of_node[here].append(index)
            if here < count and there < count:
                near[here].append(there)
    for element in network.elements:
        inside = [at[name] for name in element.corners if at[name] < count]
        for here, there in permutations(inside, 2):
            near[here].append(there)
    islands = connected(near)
    size = len(links)
    apart = [tuple(x[3 * a + c] - x[3 * b + c] for c in range(3)) for a, b in ends]
    surfaces, numbers = _lay_solids(network.solids)
    flat = [numbers[link.b] if link.solid else 0 if link.normal is None else 1 for link in links]
    nearest = [surfaces["roots"][3 * (number - 2) + 2] if number > 1 else 0 for number in flat]
    stretch = [_stretch(link, gap) for link, gap in zip(links, apart, strict=True)]
    for i, (one, _) in enumerate(ends):
        if flat[i] > 1:
            stretch[i], nearest[i] = _depth(surfaces, flat[i], nearest[i], x[3 * one : 3 * one + 3])
    elements, tissues = lay_elements(network.elements, at, count)
    arrays = Arrays3d(
        count=[count, len(network.ports), size, len(axis_port)],
        mass=[mass.mass for mass in network.masses],
        mobility=[1.0 / mass.mass for mass in network.masses],
        drag=[mass.damping for mass in network.masses],
        weight=[mass.mass * part for mass in network.masses for part in network.gravity],
        a=[one for one, _ in ends],
        b=[two for _, two in ends],
        flat=flat,
        normal=_flat([unit(link.normal or ORIGIN) for link in links]),
        links_first=list(accumulate(map(len, of_node), initial=0)),
        links_of=[index for indices in of_node for index in indices],
        islands=[mass for island in islands for mass in island],
        island_first=list(accumulate(map(len, islands), initial=0)),
        axis_port=axis_port,
        axis_way=_flat(ways),
        origin=_flat([port.offset for port in network.ports]),
        x=x,
        v=_flat([mass.velocity for mass in network.masses]) + [0.0] * (len(x) - 3 * count),
        force=[0.0] * len(x),
        pushed=[0.0] * (3 * count),
        elastic=[0.0] * size,
        way=[0.0] * (3 * size),
        apart=_flat(apart),
        bend=[0.0] * (3 * size),
        side=[0.0] * size,
        dragged=[0.0] * count,
        pumped=[0.0] * count,
        mass_numeric=[0.0] * count,
        port_work=[0.0] * len(network.ports),
        work=[0.0] * (ROWS * 3 * count),
        near=nearest,
        **surfaces,
        elements=elements,
        **link_fields(links, stretch),
    )
    kept = tuple(link.name for link in links)
    return Compiled3d(arrays, tuple(names[:count]), kept, tissues)


def port_places(network: Network3d, axes_at: Sequence[float]) -> list[Vector]:
    """Return the positions of the ports with their axes at `axes_at` [m]."""
    places = []
    given = iter(axes_at)
    for port in network.ports:
        where = list(port.offset)
        for way, _ in zip(port.directions, port.axes, strict=False):
            moved = next(given)
            where = [one + moved * part for one, part in zip(where, unit(way), strict=True)]
        places.append((where[0], where[1], where[2]))
    return places


_laid_out = functools.lru_cache(maxsize=8)(laid_out)
"""Once for each solid: a network is compiled whenever its run is engaged."""


def _lay_solids(solids: Sequence[tuple[str, Solid]]) -> tuple[dict[str, Any], dict[str, int]]:
    """Return the fields of all solids, and their numbers in `flat` by name."""
    roots: list[int] = []
    tree: list[int] = []
    boxes: list[float] = []
    faces: list[float] = []
    for _, solid in solids:
        laid = _laid_out(solid)
        node, triangle = len(tree) // NODE, len(faces) // FACE
        roots += [node, node + len(laid.tree) // NODE, triangle]
        for skip, own in zip(laid.tree[::NODE], laid.tree[1::NODE], strict=True):
            tree += [node + skip, triangle + own if own >= 0 else -1]
        boxes += laid.boxes
        faces += laid.faces
    fields = {"roots": roots, "tree": tree, "boxes": boxes, "faces": faces}
    return fields, {name: 2 + number for number, (name, _) in enumerate(solids)}


def _depth(
    surfaces: dict[str, Any], number: int, guess: int, where: Sequence[float]
) -> tuple[float, int]:
    """Return the distance of a place from a solid's surface [m], and the triangle there."""
    first, end = surfaces["roots"][3 * (number - 2) : 3 * (number - 2) + 2]
    laid = surfaces["tree"], surfaces["boxes"], surfaces["faces"]
    nearest = surface_of(*laid, first, end, guess, where[0], where[1], where[2])
    return nearest[0], nearest[4]


def _flat(vectors: Sequence[Sequence[float]]) -> list[float]:
    return [float(part) for vector in vectors for part in vector]


def _stretch(link: Link, apart: Sequence[float]) -> float:
    if link.normal is not None:
        return sum(p * n for p, n in zip(apart, unit(link.normal), strict=True)) - link.rest
    return float(sum(part * part for part in apart) ** 0.5 - link.rest)
