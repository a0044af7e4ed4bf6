"""Which contacts between points in space are closed at once, and along which way.

A plane acts along its normal. Two balls touch along a line that depends on where the port is, so
each of the ports' directions is taken. So it is of a solid: its potential k d^2 / 2, d the distance
to the surface from inside, nowhere bends up more than k in any direction, as d^2 is the least of
squares. Of balls that are alike (same law, same mass, same links around it near the start), the
nearest to its port stands for all; at once are closed those that one place of the port reaches
while the masses stand where they start.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Hashable, Iterator, Mapping, Sequence

import numpy as np

from tautwave_scenes.certificate.contacts import (
    Press,
    Regime,
    curved_links,
    pressed,
    shares,
    text_of,
)
from tautwave_scenes.certificate.joint import Matrix
from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks3d.matrices import Tangent
from tautwave_scenes.networks3d.network import ORIGIN, Network3d, Port3d, Vector, unit

DIGITS = 6
"""Digits of stiffness and damping around a mass that make it like another."""


def regimes3d(
    network: Network3d, near: Tangent, efforts: Mapping[str, float], energy: float
) -> list[Regime]:
    """Return the regimes of a network with contacts closed.

    Parameters
    ----------
    network : Network3d
        As it runs.
    near : Tangent
        Of its start.
    efforts : mapping of str to float
        By axis of a port the greatest force along it [N].
    energy : float
        In a contact that no port touches [J].
    """
    links = curved_links(network.links)
    ways = {
        tuple(round(part, 9) for part in unit(way)): unit(way)
        for port in network.ports
        for way in port.directions[: len(port.axes)]
    }
    cases = []
    for group in together3d(network, links, near):
        turning = any(link.normal is None for link in group)
        for way in ways.values() if turning else [ORIGIN]:
            along = {link.name: unit(link.normal or way) for link in group}
            forces = {
                port.name: max(_force(port, efforts, one) for one in along.values())
                for port in network.ports
            }
            for share in shares(group):
                closed = {
                    name: one._replace(way=along[name])
                    for name, one in pressed(group, Press(forces, energy), share).items()
                }
                cases.append(Regime(text_of(group, len(links)), closed))
    return cases


def _force(port: Port3d, efforts: Mapping[str, float], way: Vector) -> float:
    """Return the force along `way` [N] at which the axis that bears most of it is at its limit."""
    shares = [
        abs(sum(p * q for p, q in zip(unit(one), way, strict=True))) for one in port.directions
    ]
    share, axis = max(zip(shares, port.axes, strict=False))
    return efforts[axis] / max(share, 1e-9)


def together3d(network: Network3d, links: Sequence[Link], near: Tangent) -> list[tuple[Link, ...]]:
    """Return what may be closed at once: one of each kind, and all that one place reaches."""
    places = {mass.name: np.array(mass.position) for mass in network.masses}
    places |= {name: np.array(where) for name, where in network.grounds}
    places |= {port.name: np.array(port.offset) for port in network.ports}
    ports = {port.name for port in network.ports}
    order = {mass.name: at for at, mass in enumerate(network.masses)}

    def around(name: str) -> Hashable:
        if name not in order:
            return name if name in ports else ""
        at = 3 * order[name]
        features = [near.mass[at]]
        for whole in (near.stiffness, near.damping):
            features += [*(np.diag(whole)[at : at + 3] / max(np.abs(whole).max(), 1e-300))]
        return tuple(round(float(value), DIGITS) for value in features)

    def gap(link: Link) -> float:
        return float(np.linalg.norm(places[link.a] - places[link.b]))

    kinds: dict[Hashable, Link] = {}
    for link in sorted(links, key=gap):
        kinds.setdefault((link._replace(name="", a="", b=""), around(link.a), around(link.b)), link)
    groups: list[tuple[Link, ...]] = [(link,) for link in kinds.values()]
    planes = [link for link in links if link.normal is not None or link.solid]
    balls = [link for link in links if link.normal is None and not link.solid]
    for port in network.ports:
        touching = [link for link in balls if port.name in (link.a, link.b)]
        groups.append((*planes, *max(_reached(touching, port.name, places), key=len, default=())))
    return list(dict.fromkeys(group for group in groups if group))


def _reached(
    links: Sequence[Link], port: str, places: dict[str, Matrix]
) -> Iterator[tuple[Link, ...]]:
    """Yield sets of balls that a port touches at once, from places among them."""
    ends = [places[link.b if link.a == port else link.a] for link in links]
    tried: list[Vector] = [tuple(end) for end in ends]
    for one, two in itertools.combinations(range(len(links)), 2):
        if math.dist(ends[one], ends[two]) < links[one].rest + links[two].rest:
            tried.append(tuple(0.5 * (ends[one] + ends[two])))
    for place in dict.fromkeys(tried):
        yield tuple(
            link
            for link, end in zip(links, ends, strict=True)
            if math.dist(place, end) < link.rest * (1.0 - 1e-9)
        )
