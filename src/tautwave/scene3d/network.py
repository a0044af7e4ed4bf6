"""A network of points in three dimensions as plain data, its pruning, and its mistakes.

Links are those of `tautwave.scene.network`; names follow the same rules. Pruning and loose ends
depend on names alone, and use the one-dimensional network with the same names.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.scene.network import GROUND, Link, Mass, Network
from tautwave.scene.pruning import prune

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

    `forced` are masses and the unit vectors of their external forces.
    """

    masses: tuple[Mass3d, ...]
    links: tuple[Link, ...]
    ports: tuple[Port3d, ...] = ()
    grounds: tuple[tuple[str, Vector], ...] = ((GROUND, ORIGIN),)
    forced: tuple[tuple[str, Vector], ...] = ()
    recorded: tuple[str, ...] = ()
    gravity: Vector = ORIGIN

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the devices' axes, port by port."""
        return tuple(name for port in self.ports for name in port.axes)


class Pruned3d(NamedTuple):
    """The remaining network, and a sentence for each element left out or merged."""

    network: Network3d
    left_out: tuple[str, ...]


def unit(vector: Vector) -> Vector:
    """Return the unit vector, or nothing for a zero vector."""
    size = math.sqrt(sum(part * part for part in vector))
    return (vector[0] / size, vector[1] / size, vector[2] / size) if size > 0.0 else ORIGIN


def skeleton(network: Network3d) -> Network:
    """Return the one-dimensional network with the same names, masses and links."""
    return Network(
        tuple(Mass(mass.name, mass.mass) for mass in network.masses),
        network.links,
        tuple(port.name for port in network.ports),
        tuple((name, 0.0) for name, _ in network.grounds),
        tuple(dict.fromkeys(name for name, _ in network.forced)),
        network.recorded,
    )


def prune_network3d(network: Network3d, *, merge: bool = True) -> Pruned3d:
    """Return the smallest network that is equivalent at all ports and recorded masses.

    See `tautwave.scene.pruning`: all remaining numbers are identical to the bit.
    """
    small, left_out = prune(skeleton(network), merge=merge)
    masses = {mass.name for mass in small.masses}
    grounds = {name for name, _ in small.grounds}
    kept = network._replace(
        masses=tuple(mass for mass in network.masses if mass.name in masses),
        links=small.links,
        grounds=tuple(ground for ground in network.grounds if ground[0] in grounds),
        forced=tuple(force for force in network.forced if force[0] in masses),
    )
    return Pruned3d(kept, left_out)
