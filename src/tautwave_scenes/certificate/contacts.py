"""A scene's contacts closed: which of them at once, how steep they are, what its ports then need.

A closed contact is a spring both ways, of the stiffness that it has where it is pressed hardest,
and Hunt and Crossley's loss a damper. At a port it is pressed with the effort limit at most: beyond
it the effort no longer rises, and several contacts on one side share it. Elsewhere it holds the
energy of the devices at their velocity limits. A contact that stiffens with depth is also taken at
a tenth and at a hundredth of that force. For a contact from a port to the ground the bound covers
opening and closing as well: its effort is the slope of a convex potential, and a held one leaks
K dx**2 / 2 a period at most.
"""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tautwave_scenes.certificate.joint import (
    JointNeed,
    Matrix,
    joint_poles,
    needed_together,
    radius_of,
)
from tautwave_scenes.models.link_kinds import LINK_KINDS
from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks.sampled import PortMap

FORCES = (1.0, 0.1, 0.01)
"""Shares of the greatest force at which a contact that stiffens with depth is taken."""

LEAST = 1e-4
"""Smallest share of the contacts' stiffness that is tried as a remedy."""

FEW = 4
"""Number of contacts up to which every subset of them is closed at once."""


class Pressed(NamedTuple):
    """A closed contact: stiffness [N/m] and damping [N s/m] where it is pressed with `force` [N].

    `way` is its direction in three dimensions.
    """

    stiffness: float
    damping: float
    force: float
    way: tuple[float, float, float] | None = None


class Regime(NamedTuple):
    """Contacts that are closed at once, by the names of their links."""

    text: str
    closed: Mapping[str, Pressed]


class Press(NamedTuple):
    """What presses on contacts: by port the greatest force [N], elsewhere an energy [J]."""

    forces: Mapping[str, float]
    energy: float


Maps = Callable[[Regime], PortMap]
Kind = Callable[[Link], Hashable]


def curved_links(links: Iterable[Link]) -> list[Link]:
    """Return the links that open and close, or stiffen."""
    return [
        link for link in links if LINK_KINDS[link.kind].proof == "curved" and link.stiffness > 0.0
    ]


def is_wall(link: Link, ports: Collection[str], fixed: Collection[str]) -> bool:
    """Return whether a contact without loss is between a port and the ground."""
    ends = {link.a, link.b}
    kind = LINK_KINDS[link.kind]
    lossless = kind.proof == "curved" and kind.potential and link.loss == link.damping == 0.0
    return lossless and len(ends & set(ports)) == 1 and len(ends & set(fixed)) == 1


def together(links: Sequence[Link], kind: Kind) -> list[tuple[Link, ...]]:
    """Return what may be closed at once.

    Up to `FEW` links: every subset. Of more, with alike ones taken once: each, those at one node,
    those of a kind, and all.
    """
    if len(links) <= FEW:
        sizes = range(1, len(links) + 1)
        return [chosen for size in sizes for chosen in itertools.combinations(links, size)]
    kinds: dict[Hashable, list[Link]] = {}
    at_node: dict[str, list[Link]] = {}
    for link in links:
        kinds.setdefault(kind(link), []).append(link)
        for end in (link.a, link.b):
            at_node.setdefault(end, []).append(link)
    choices: list[tuple[Link, ...]] = [(group[0],) for group in kinds.values()]
    seen = set()
    for group in at_node.values():
        key = tuple(kind(link) for link in group)
        if len(group) <= FEW and key not in seen:
            seen.add(key)
            choices.append(tuple(group))
    choices += [tuple(group) for group in kinds.values()]
    return list(dict.fromkeys([*choices, tuple(links)]))


def pressed(group: Sequence[Link], press: Press, share: float) -> dict[str, Pressed]:
    """Return how steep links are when pressed at once with `share` of the greatest force."""
    sides = Counter((end, end == link.a) for link in group for end in (link.a, link.b))
    by_link = {}
    for link in group:
        k, e = link.stiffness, link.exponent
        at_ports = [
            press.forces[end] / sides[end, end == link.a]
            for end in (link.a, link.b)
            if end in press.forces
        ]
        depth = ((e + 1.0) * press.energy / k) ** (1.0 / (e + 1.0))
        force = share * min(at_ports, default=k * depth**e)
        if LINK_KINDS[link.kind].bounded:
            force = min(force, link.limit)
        depth = (force / k) ** (1.0 / e)
        by_link[link.name] = Pressed(
            e * k * depth ** (e - 1.0), link.damping + link.loss * force, force
        )
    return by_link


def regimes(links: Sequence[Link], press: Press, kind: Kind) -> list[Regime]:
    """Return the regimes of a scene with contacts closed: `together`, at each of `FORCES`."""
    return [
        Regime(text_of(group, len(links)), pressed(group, press, share))
        for group in together(links, kind)
        for share in shares(group)
    ]


def shares(group: Iterable[Link]) -> tuple[float, ...]:
    """Return the shares of the greatest force at which links are to be taken."""
    stiffens = any(link.exponent != 1.0 or link.loss > 0.0 for link in group)
    return FORCES if stiffens else FORCES[:1]


def text_of(group: Sequence[Link], count: int) -> str:
    """Name a regime: `with felt closed`."""
    if len(group) > 3:
        all_of = "all" if len(group) == count else f"{group[0].name} to {group[-1].name},"
        return f"with {all_of} {len(group)} contacts closed"
    return f"with {' and '.join(link.name for link in group)} closed"


class Worst(NamedTuple):
    """The regime that needs most of the devices, with its need."""

    regime: Regime
    need: JointNeed


def worst_need(
    found: Iterable[tuple[Regime, PortMap]], damping: Matrix, delays: Matrix
) -> Worst | None:
    """Return the regime that needs the greatest share of the devices' damping."""
    needs = (Worst(regime, needed_together(law, damping, delays)) for regime, law in found)
    return max(needs, key=lambda one: one.need.share, default=None)


def borne(worst: Worst, maps: Maps, damping: Matrix, delays: Matrix) -> float:
    """Return the share of the contacts' stiffness that the devices bear; 0 if none."""

    def share(factor: float) -> float:
        closed = {
            name: one._replace(stiffness=factor * one.stiffness)
            for name, one in worst.regime.closed.items()
        }
        return needed_together(maps(worst.regime._replace(closed=closed)), damping, delays).share

    low, high = LEAST, 1.0
    if share(low) > 1.0:
        return 0.0
    for _ in range(16):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if share(middle) > 1.0 else (middle, high)
    return low


class ClosedPoles(NamedTuple):
    """The least damped pole of a loop with contacts closed, or that of the scene by itself."""

    regime: Regime
    mass: str
    pole: complex
    alone: bool


def closed_poles(
    found: Iterable[tuple[Regime, PortMap]],
    ends: Mapping[str, tuple[Matrix, Matrix, Matrix]],
    delays: list[int],
    split: float,
) -> Iterator[ClosedPoles]:
    """Yield the worst pole of every regime, and bound of the inertia.

    `ends` are masses, dampings and stiffnesses of devices and hands by the bound that they take.
    """
    for regime, law in found:
        own = radius_of(law)
        if own > 1.0 + split:
            yield ClosedPoles(regime, "", complex(own), True)
            continue
        for bound, values in ends.items():
            poles = joint_poles(law, *values, delays)
            yield ClosedPoles(regime, bound, complex(poles[np.argmax(np.abs(poles))]), False)


def steepness(regime: Regime, unit: str) -> str:
    """Say how steep the steepest contact of a regime is; `unit` is that of a stiffness."""
    one = max(regime.closed.values(), key=lambda found: found.stiffness)
    effort, _, motion = unit.partition("/")
    loss = f" and {one.damping:.4g} {effort} s/{motion}" if one.damping else ""
    return f"{one.stiffness:.4g} {unit}{loss} at {one.force:.4g} {effort}"
