"""From a network to flat arrays: nodes are masses, then ports, then grounds; links sorted by law.

The same arrays are lists of floats live and NumPy arrays in compiled code (`as_arrays`).
Coordinates are indexed by node.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from tautwave_scenes.models.interaction import elastic_energy
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.networks.network import Link, Mass, Network, String
from tautwave_scenes.networks.parallel_links import join_links

ORDER = tuple(dict.fromkeys(kind.number for kind in LINK_KINDS.values()))

Numbers = Any
"""A list of floats (live) or a float64 array (compiled); ints in the index arrays."""


class Arrays(NamedTuple):
    """A network and its state, laid out for `stepping` and `gradient`.

    Sizes: n masses, p ports, g grounds, N = n + p + g nodes, l links. `count` is (n, p, l,
    contacts). Constant: `mass`, its inverse `mobility`, `drag`, `weight` (n); `kind`, `a`, `b`,
    `k`, `z`, `rest`, `e`, `loss`, `limit`, `scale` (l); `links_first` (n + 1) and `links_of`: links
    of each mass; `islands` and `island_first`: masses solved together, `alone`: the others.

    State: `x`, `v` (N), `force` (N) of the links on the nodes, `pushed` (n) external force; of each
    link `tension`, `stretch`, `slope`, `set_in`. Books [J]: `stored`, `lost`, `made`, `numeric`
    (l), `dragged`, `pumped`, `mass_numeric` (n), `port_work` (p). `work` is scratch, (8, n) flat.
    """

    count: Numbers
    mass: Numbers
    mobility: Numbers
    drag: Numbers
    weight: Numbers
    kind: Numbers
    a: Numbers
    b: Numbers
    k: Numbers
    z: Numbers
    rest: Numbers
    e: Numbers
    loss: Numbers
    limit: Numbers
    scale: Numbers
    links_first: Numbers
    links_of: Numbers
    alone: Numbers
    islands: Numbers
    island_first: Numbers
    x: Numbers
    v: Numbers
    force: Numbers
    pushed: Numbers
    tension: Numbers
    stretch: Numbers
    slope: Numbers
    set_in: Numbers
    stored: Numbers
    lost: Numbers
    made: Numbers
    numeric: Numbers
    dragged: Numbers
    pumped: Numbers
    mass_numeric: Numbers
    port_work: Numbers
    work: Numbers


INDEX_FIELDS = (
    *("count", "kind", "a", "b", "links_first", "links_of"),
    *("alone", "islands", "island_first"),
)


class Compiled(NamedTuple):
    """Arrays of a network, and the names behind the indices; `links` in the order of the arrays."""

    arrays: Arrays
    masses: tuple[str, ...]
    ports: tuple[str, ...]
    links: tuple[str, ...]


def compile_network(network: Network, ports_at: Sequence[float] = ()) -> Compiled:
    """Return a network as lists, at rest in its initial state.

    The first of several identical parallel links carries the strength of all, the others none.

    Parameters
    ----------
    network : Network
        Its nodes and links as `config.checks.scene` wants them.
    ports_at : sequence of float
        Positions of the ports [m]; 0 if not given.
    """
    masses = (*network.masses, *map(_end_mass, network.strings))
    count = len(masses)
    names = [mass.name for mass in masses]
    places = list(ports_at) or [0.0] * len(network.ports)
    names += [*network.ports, *(name for name, _ in network.grounds)]
    at = {name: index for index, name in enumerate(names)}
    x = [mass.position for mass in masses] + places + [where for _, where in network.grounds]
    v = [mass.velocity for mass in masses] + [0.0] * (len(names) - count)
    links = ordered_links(network.links)
    a = [at[link.a] for link in links]
    b = [at[link.b] for link in links]
    of_mass: list[list[int]] = [[] for _ in masses]
    near: list[list[int]] = [[] for _ in masses]
    for index, (one, two) in enumerate(zip(a, b, strict=True)):
        for here, there in ((one, two), (two, one)):
            if here < count:
                of_mass[here].append(index)
                if there < count:
                    near[here].append(there)
    islands = [group for group in connected(near) if near[group[0]]]
    stretch = [x[one] - x[two] - link.rest for one, two, link in zip(a, b, links, strict=True)]
    arrays = Arrays(
        count=[
            count,
            len(network.ports),
            len(links),
            sum(LINK_KINDS[link.kind].one_way for link in links),
        ],
        mass=[mass.mass for mass in masses],
        mobility=[1.0 / mass.mass if mass.mass else 0.0 for mass in masses],
        drag=[mass.damping for mass in masses],
        weight=[-mass.mass * network.gravity for mass in masses],
        a=a,
        b=b,
        links_first=list(accumulate(map(len, of_mass), initial=0)),
        links_of=[index for indices in of_mass for index in indices],
        alone=[mass for mass, others in enumerate(near) if not others],
        islands=[mass for island in islands for mass in island],
        island_first=list(accumulate(map(len, islands), initial=0)),
        x=x,
        v=v,
        force=[0.0] * len(names),
        pushed=[0.0] * count,
        slope=[0.0] * len(links),
        dragged=[0.0] * count,
        pumped=[0.0] * count,
        mass_numeric=[0.0] * count,
        port_work=[0.0] * len(network.ports),
        work=[0.0] * (8 * count),
        **link_fields(links, stretch),
    )
    return Compiled(arrays, tuple(names[:count]), network.ports, tuple(link.name for link in links))


def ordered_links(links: Sequence[Link]) -> list[Link]:
    """Return the links in the order of their laws, identical parallel ones joined."""
    joined = [link for link, _ in join_links(links)]
    return sorted(joined, key=lambda link: ORDER.index(LINK_KINDS[link.kind].number))


def link_fields(links: Sequence[Link], stretch: list[float]) -> dict[str, Any]:
    """Return the fields of links that no dimension changes; `stretch` [m] is that of the start."""
    kind = [LINK_KINDS[link.kind].number for link in links]
    nothing = ("tension", "set_in", "lost", "made", "numeric")
    return {
        "kind": kind,
        "k": [link.stiffness for link in links],
        "z": [link.damping for link in links],
        "rest": [link.rest for link in links],
        "e": [link.exponent for link in links],
        "loss": [link.loss for link in links],
        "limit": [link.limit for link in links],
        "scale": [link.scale for link in links],
        "stretch": stretch,
        "stored": [
            elastic_energy(law_of, link.stiffness, link.exponent, d) if link.stiffness else 0.0
            for law_of, link, d in zip(kind, links, stretch, strict=True)
        ],
        **{name: [0.0] * len(links) for name in nothing},
    }


def _end_mass(string: String) -> Mass:
    """Return the node of a string: it resists with both lines' impedance, and has no mass."""
    return Mass(string.name, 0.0, damping=2.0 * string.impedance)


def as_arrays(arrays: Arrays) -> Arrays:
    """Return a copy for compiled code: int64 and float64 arrays."""
    import numpy as np

    return Arrays(
        *(
            np.array(values, np.int64 if name in INDEX_FIELDS else np.float64)
            for name, values in zip(Arrays._fields, arrays, strict=True)
        )
    )


def connected(near: Sequence[Sequence[int]]) -> list[list[int]]:
    """Return the groups of masses that links join, each in order; `near`: neighbours of a mass."""
    seen = [False] * len(near)
    groups = []
    for start in range(len(near)):
        if seen[start]:
            continue
        seen[start] = True
        group = [start]
        for mass in group:
            for other in near[mass]:
                if not seen[other]:
                    seen[other] = True
                    group.append(other)
        groups.append(sorted(group))
    return groups
