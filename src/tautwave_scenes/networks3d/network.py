"""A network of points in three dimensions as plain data, its pruning, and its mistakes.

Links are those of `networks.network`; names follow the same rules. Pruning and loose ends
depend on names alone, and use the one-dimensional network with the same names.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave_scenes.models.solid import Solid
from tautwave_scenes.networks.network import GROUND, Link, Mass, Network
from tautwave_scenes.networks.pruning import prune
from tautwave_scenes.networks3d.elements import Element
from tautwave_scenes.networks3d.tool import Carried, Tool3d

Vector = tuple[float, float, float]
ORIGIN: Vector = (0.0, 0.0, 0.0)
WAYS: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class Mass3d(NamedTuple):
    """A mass [kg], its initial position and velocity [m, m/s], its damping to ground [N s/m]."""

    name: str
    mass: float
    position: Vector = ORIGIN
    velocity: Vector = ORIGIN
    damping: float = 0.0


class Port3d(NamedTuple):
    """A point moved by axes of a device, each along a unit vector (`unit`).

    It is at `offset` [m] plus the sum of each axis' position times its direction.
    """

    name: str
    axes: tuple[str, ...]
    directions: tuple[Vector, ...] = WAYS
    offset: Vector = ORIGIN


class Network3d(NamedTuple):
    """Masses, links, ports and grounds (name, position [m]); `gravity` [m/s**2] is a vector.

    `forced` are masses and the unit vectors of their external forces; `elements` tetrahedra of
    tissue between masses and grounds; `solids` surfaces, at their place, by the name of a ground;
    `tools` carry ports that follow each other, with the axes `NAME.x`, `NAME.y` and `NAME.z`.
    """

    masses: tuple[Mass3d, ...]
    links: tuple[Link, ...]
    ports: tuple[Port3d, ...] = ()
    grounds: tuple[tuple[str, Vector], ...] = ((GROUND, ORIGIN),)
    forced: tuple[tuple[str, Vector], ...] = ()
    recorded: tuple[str, ...] = ()
    gravity: Vector = ORIGIN
    elements: tuple[Element, ...] = ()
    tools: tuple[Tool3d, ...] = ()
    solids: tuple[tuple[str, Solid], ...] = ()

    @property
    def grips(self) -> tuple[tuple[str, tuple[str, ...]], ...]:
        """What devices hold, ports and tools by name, and the axes of each."""
        carried = {point: tool for tool in self.tools for point, _ in tool.points}
        axes_of: dict[str, tuple[str, ...]] = {}
        for port in self.ports:
            tool = carried.get(port.name)
            if tool is None:
                axes_of[port.name] = port.axes
            else:
                axes_of[tool.name] = tool.axes + tool.turns
        return tuple(axes_of.items())

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the devices' axes, port by port."""
        return tuple(name for _, axes in self.grips for name in axes)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the ports' own axes: the devices' where no tool is between."""
        return tuple(name for port in self.ports for name in port.axes)

    def carried(self) -> Carried:
        """Return what is between the devices' axes and the ports' coordinates."""
        tools = {tool.name: tool for tool in self.tools}
        return Carried([(len(axes), tools.get(name)) for name, axes in self.grips])


class Pruned3d(NamedTuple):
    """The remaining network, and a sentence for each element left out or merged."""

    network: Network3d
    left_out: tuple[str, ...]


def unit(vector: Vector) -> Vector:
    """Return the unit vector, or nothing for a zero vector."""
    size = math.sqrt(sum(part * part for part in vector))
    return (vector[0] / size, vector[1] / size, vector[2] / size) if size > 0.0 else ORIGIN


BOND = "tissue "
"""Begins the name of what stands for a tissue between two of its nodes in a skeleton."""


def bonds(network: Network3d) -> tuple[Link, ...]:
    """Return links that join the nodes of every tissue, each to the first of it that can move."""
    fixed = {name for name, _ in network.grounds}
    corners: dict[str, dict[str, None]] = {}
    for element in network.elements:
        corners.setdefault(element.tissue, {}).update(dict.fromkeys(element.corners))
    return tuple(
        Link(f"{BOND}{tissue} {name}", "spring", first, name, 1.0)
        for tissue, nodes in corners.items()
        for first in [next((name for name in nodes if name not in fixed), "")]
        for name in nodes
        if first and name != first
    )


def skeleton(network: Network3d) -> Network:
    """Return the one-dimensional network with the same names, masses and links."""
    return Network(
        tuple(Mass(mass.name, mass.mass) for mass in network.masses),
        network.links + bonds(network),
        tuple(port.name for port in network.ports),
        tuple((name, 0.0) for name, _ in network.grounds),
        tuple(dict.fromkeys(name for name, _ in network.forced)),
        network.recorded,
    )


def prune_network3d(network: Network3d, *, merge: bool = True) -> Pruned3d:
    """Return the smallest network that is equivalent at all ports and recorded masses.

    See `networks.pruning`: all remaining numbers are identical to the bit.
    """
    small, left_out = prune(skeleton(network), merge=merge)
    masses = {mass.name for mass in small.masses}
    grounds = {name for name, _ in small.grounds}
    nodes = masses | grounds
    kept = network._replace(
        masses=tuple(mass for mass in network.masses if mass.name in masses),
        links=tuple(link for link in small.links if not link.name.startswith(BOND)),
        elements=tuple(e for e in network.elements if nodes.issuperset(e.corners)),
        grounds=tuple(ground for ground in network.grounds if ground[0] in grounds),
        forced=tuple(force for force in network.forced if force[0] in masses),
    )
    return Pruned3d(kept, tuple(line for line in left_out if not line.startswith(f"link {BOND}")))
