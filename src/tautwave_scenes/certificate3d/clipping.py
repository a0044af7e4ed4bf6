"""Ports in space, and what each motor's limit makes of the network's passivity.

As in one dimension (`certificate.clipping`), ports that a network joins generate energy without end
unless two of them, each moved along one line and held by nothing else, are clipped at one force.

A port that several axes move feels a force that has a potential. What its motors clip of it, each
along its own axis, has none, even where their limits are alike: at a place where one is clipped and
another is not, a step along the first changes the force of the second, and not the other way round.
So such a port is passive on the condition that none of its motors is at its limit, and the account
of the run (`runtime.hold`) ends it otherwise.

Source: derived here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.certificate.data import Element
from tautwave_scenes.certificate.clipping import (
    ALIKE,
    clip_condition,
    groups,
    is_grounded,
    joined,
    limits_element,
)
from tautwave_scenes.networks3d.network import ORIGIN, Network3d, Vector, skeleton


def limits_elements(network: Network3d, limits: Mapping[str, float]) -> Iterator[Element]:
    """Yield the verdict on the limits of each group of ports that the network joins.

    `limits`: the scene's force at which the motor of each axis is at its limit [N or N m].
    """
    lines = skeleton(network)
    fixed = {name for name, _ in network.grounds}
    holds = {port.name: port.name for port in network.ports}
    holds |= {point: tool.name for tool in network.tools for point, _ in tool.points}
    ways = _ways(network)
    axes_of = dict(network.grips)
    for nodes in groups(lines, fixed):
        grips = list(dict.fromkeys(holds[name] for name in lines.ports if name in nodes))
        if len(grips) < 2:
            continue
        heavy = network.gravity != ORIGIN and any(mass.name in nodes for mass in network.masses)
        grounded = is_grounded(lines.links, nodes, fixed)
        axes = [axis for grip in grips for axis in axes_of[grip]]
        why = joined(len(grips), grounded=grounded, heavy=heavy)
        if not why and not _one_line([ways[axis] for axis in axes]):
            why = "their axes are not along one line"
        yield limits_element(axes, {axis: limits[axis] for axis in axes}, why)


def limit_conditions(network: Network3d, axis: str) -> tuple[str, ...]:
    """Return the condition on an axis' motor; none where it moves a port alone, and no mass."""
    [grip] = [name for name, axes in network.grips if axis in axes]
    if len(dict(network.grips)[grip]) > 1:
        return (
            f"the motor of master.{axis} is not at its effort_limit while other axes move {grip}; "
            "the run's account stops it otherwise",
        )
    return clip_condition(bool(network.masses), f"master.{axis}")


def _ways(network: Network3d) -> dict[str, Vector | None]:
    """Return the direction of each axis, None of one that turns a tool."""
    directions: dict[str, Vector | None] = {}
    for port in network.ports:
        directions |= zip(port.axes, port.directions, strict=False)
    for tool in network.tools:
        directions |= zip(tool.axes, tool.ways, strict=True)
        directions |= dict.fromkeys(tool.turns)
    return directions


def _one_line(ways: list[Vector | None]) -> bool:
    """Return whether two axes are along one line; more than two are not looked at."""
    one, two, *more = ways
    if more or one is None or two is None:
        return False
    along = sum(a * b for a, b in zip(one, two, strict=True))
    return math.fabs(math.fabs(along) - 1.0) < ALIKE
