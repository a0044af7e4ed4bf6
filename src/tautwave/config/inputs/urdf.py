"""Serial chains from URDF files: joints, axes, origins, inertials, limits; nothing else is read."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from tautwave.config.inputs.urdf_text import Node, UrdfReader
from tautwave.errors import ConfigError
from tautwave.models.chain.build import (
    ORIGIN,
    UNIT,
    Body,
    Link,
    Matrix,
    Vector,
    joined,
    moved,
    placed,
    times,
)

KINDS = {"revolute": "turns", "continuous": "turns", "prismatic": "slides", "fixed": "fixed"}


class JointLimits(NamedTuple):
    """Limits of one joint; infinite where the file gives none [rad or m, N m or N]."""

    name: str
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf


class UrdfChain(NamedTuple):
    """Links from base to tip, those that are fixed included, and the limits of what moves."""

    links: tuple[Link, ...]
    limits: tuple[JointLimits, ...]


class _Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    child: str
    node: Node


def read_urdf(path: Path, tip: str | None = None) -> UrdfChain:
    """Return the serial chain of a URDF file.

    Parameters
    ----------
    path : Path
        The file.
    tip : str, optional
        Name of the last link; default: that behind the last joint that moves. Whatever is fixed to
        the chain belongs to its bodies in any case.

    Raises
    ------
    ConfigError
        Not readable, not a URDF file, or not a serial chain: file, line and name.
    """
    reader = UrdfReader(path)
    robot = reader.tree()
    links = reader.by_name(robot.all("link"))
    if not links:
        raise reader.wrong(robot.line, "has no <link>; xacro has to be run first")
    joints = [_joint(reader, node, links) for node in reader.by_name(robot.all("joint")).values()]
    below: dict[str, list[_Joint]] = {name: [] for name in links}
    above: dict[str, _Joint] = {}
    for joint in joints:
        other = above.setdefault(joint.child, joint)
        if other is not joint:
            raise reader.wrong(
                joint.node.line,
                f"joint {joint.name!r}: link {joint.child!r} is also the child of joint "
                f"{other.name!r} (line {other.node.line}): closed chains are not supported",
            )
        below[joint.parent].append(joint)
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        raise reader.wrong(
            links[roots[1]].line,
            f"link {roots[1]!r} is not connected to {roots[0]!r}; the links must form one tree",
        )
    order = roots[:1]
    for name in order:
        order += [joint.child for joint in below[name]]
    reached = set(order)
    for joint in joints:
        if joint.child not in reached:
            raise reader.wrong(
                joint.node.line,
                f"joint {joint.name!r} closes a loop; only serial chains are supported",
            )
    if tip is not None and tip not in links:
        raise ConfigError(f"{path}: there is no link {tip!r}. Links: {', '.join(links)}")
    moves: dict[str, bool] = {}  # whether anything moves behind a link
    for name in reversed(order):
        moves[name] = any(j.kind != "fixed" or moves[j.child] for j in below[name])
    route = _route(reader, order[0], below, above, moves, tip)
    taken = {joint.child for joint in route}
    made = []
    limits = []
    for joint in route:
        place, turn = reader.origin(joint.node)
        body = _body(reader, links, below, joint.child, taken)
        axis = (0.0, 0.0, 1.0) if joint.kind == "fixed" else _axis(reader, joint)
        made.append(Link(joint.name, joint.kind, place, turn, axis, body))
        if joint.kind != "fixed":
            limits.append(_limits(reader, joint))
    if not limits:
        raise reader.wrong(robot.line, "has no moving joint between its base and its tip")
    return UrdfChain(tuple(made), tuple(limits))


def _joint(reader: UrdfReader, node: Node, links: Mapping[str, Node]) -> _Joint:
    name, kind = node.given["name"], reader.word(node, "type")
    if kind not in KINDS:
        known = ", ".join(KINDS)
        raise reader.wrong(node.line, f"joint {name!r} is {kind}; a chain has {known} joints")
    if node.all("mimic"):
        raise reader.wrong(
            node.line, f"joint {name!r} mimics another, which a serial chain cannot; make it fixed"
        )
    ends = []
    for which in ("parent", "child"):
        end = reader.one(node, which)
        if end is None:
            raise reader.wrong(node.line, f"joint {name!r} has no <{which}>")
        link = reader.word(end, "link")
        if link not in links:
            raise reader.wrong(end.line, f"joint {name!r}: there is no link {link!r}")
        ends.append(link)
    return _Joint(name, KINDS[kind], ends[0], ends[1], node)


def _route(
    reader: UrdfReader,
    root: str,
    below: Mapping[str, list[_Joint]],
    above: Mapping[str, _Joint],
    moves: Mapping[str, bool],
    tip: str | None,
) -> list[_Joint]:
    """Return the joints from the base to the tip; nothing beside them may move."""
    wanted: dict[str, _Joint] = {}
    at = tip
    while at is not None and at in above:
        wanted[above[at].parent] = above[at]
        at = above[at].parent
    route: list[_Joint] = []
    at = root
    while at is not None:
        moving = [joint for joint in below[at] if joint.kind != "fixed" or moves[joint.child]]
        chosen = wanted.get(at) if tip is not None else next(iter(moving), None)
        for joint in moving:
            if joint is not chosen:
                raise reader.wrong(
                    joint.node.line,
                    f"joint {joint.name!r} branches off at link {at!r}: only serial chains are "
                    "supported; fix the moving joints of all other branches",
                )
        if chosen is not None:
            route.append(chosen)
        at = None if chosen is None else chosen.child
    return route


def _body(
    reader: UrdfReader,
    links: Mapping[str, Node],
    below: Mapping[str, list[_Joint]],
    link: str,
    taken: set[str],
) -> Body:
    """Return a link's body with all that is fixed to it and not on the route."""
    body = Body()
    todo: list[tuple[str, Vector, Matrix]] = [(link, ORIGIN, UNIT)]
    while todo:
        name, at, there = todo.pop()
        body = joined(body, placed(reader.body(links[name]), there, at))
        for joint in below[name]:
            if joint.child not in taken:
                place, turn = reader.origin(joint.node)
                todo.append((joint.child, moved(there, place, at), times(there, turn)))
    return body


def _axis(reader: UrdfReader, joint: _Joint) -> Vector:
    given = reader.one(joint.node, "axis")
    x, y, z = reader.vector(given, "xyz", (1.0, 0.0, 0.0))
    size = math.hypot(x, y, z)
    if not 1e-6 < size < math.inf:
        line = joint.node.line if given is None else given.line
        raise reader.wrong(line, f"joint {joint.name!r}: its axis vector is zero or not finite")
    return x / size, y / size, z / size


def _limits(reader: UrdfReader, joint: _Joint) -> JointLimits:
    given = reader.one(joint.node, "limit")
    if given is None:
        return JointLimits(joint.name)
    effort = reader.number(given, "effort", math.inf) if "effort" in given.given else math.inf
    if joint.node.given["type"] == "continuous":
        return JointLimits(joint.name, effort=effort)
    lower, upper = reader.number(given, "lower", 0.0), reader.number(given, "upper", 0.0)
    if lower > upper:
        raise reader.wrong(
            given.line,
            f"joint {joint.name!r}: its lower limit {lower:g} is above its upper {upper:g}",
        )
    return JointLimits(joint.name, lower, upper, effort)
