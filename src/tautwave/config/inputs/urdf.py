"""Serial chains from URDF files: joints, axes, origins, inertials, limits; nothing else is read.

With a tip, the chain is the path to it. What moves beside that path, such as a gripper, is held
where it is said to be, and is part of the body that carries it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
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
    about_z,
    joined,
    moved,
    placed,
    times,
    transposed,
    z_along,
)

KINDS = {"revolute": "turns", "continuous": "turns", "prismatic": "slides", "fixed": "fixed"}


class JointLimits(NamedTuple):
    """Limits of one joint; infinite where the file gives none [rad or m, N m or N, per s].

    A range without width, and an effort or a velocity of 0, are placeholders: none is given. Also
    what the file has of the joint's friction: viscous [N m s/rad or N s/m] and dry [N m or N].
    """

    name: str
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    velocity: float = math.inf
    damping: float = 0.0
    friction: float = 0.0


class UrdfChain(NamedTuple):
    """Links from base to tip, those that are fixed included, and the limits of what moves.

    `notes` say what was odd in the file beside the chain, and what was taken instead.
    """

    links: tuple[Link, ...]
    limits: tuple[JointLimits, ...]
    notes: tuple[str, ...] = ()


MOST_TURNED = 50.0
"""[rad] Beyond, limits are taken for degrees: arms with several turns have at most five."""


class _Joint(NamedTuple):
    name: str
    kind: str
    parent: str
    child: str
    node: Node
    locked: float | None = None


def read_urdf(
    path: Path,
    tip: str | None = None,
    base: str | None = None,
    held: Mapping[str, float] | None = None,
) -> UrdfChain:
    """Return the serial chain of a URDF file.

    Parameters
    ----------
    path : Path
        The file.
    tip : str, optional
        Name of the last link; default: that behind the last joint that moves, in a file where
        nothing branches off. Whatever is fixed to the chain belongs to its bodies in any case.
    base : str, optional
        Name of the link that the chain stands on; default: the root of the file.
    held : mapping, optional
        Where joints beside the chain are held [rad or m], by name; default: 0.

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
    for end in (tip, base):
        if end is not None and end not in links:
            raise ConfigError(f"{path}: there is no link {end!r}. Links: {', '.join(links)}")
    stands = order[0] if base is None else base
    if tip is None:
        moves: dict[str, bool] = {}  # whether anything moves behind a link
        for name in reversed(order):
            moves[name] = any(j.kind != "fixed" or moves[j.child] for j in below[name])
        route = _only_route(reader, stands, below, moves)
    else:
        route = _route_to(path, stands, tip, above)
    taken = {joint.name for joint in route}
    places = held or {}
    for name in places:
        if name in taken or name not in {joint.name for joint in joints if joint.kind != "fixed"}:
            why = "is part of the chain" if name in taken else "is no joint of the file that moves"
            raise ConfigError(f"{path}: joint {name!r} {why}; remove it from held")
    made = []
    limits = []
    notes: list[str] = []
    for joint in route:
        _check_in_chain(reader, joint)
        place, turn = _origin(reader, joint)
        if joint.locked is not None:
            notes.append(
                f"joint {joint.name!r} is locked at {joint.locked:g} (its lower limit is its "
                "upper), and counts as fixed; if it moves, the file needs its range"
            )
        body = _body(reader, links, below, joint.child, taken, places, notes)
        axis = (0.0, 0.0, 1.0) if joint.kind == "fixed" else _axis(reader, joint)
        made.append(Link(joint.name, joint.kind, place, turn, axis, body))
        if joint.kind != "fixed":
            limits.append(_limits(reader, joint))
    if not limits:
        raise reader.wrong(robot.line, "has no moving joint between its base and its tip")
    return UrdfChain(tuple(made), tuple(limits), tuple(notes))


def _joint(reader: UrdfReader, node: Node, links: Mapping[str, Node]) -> _Joint:
    name, kind = node.given["name"], reader.word(node, "type")
    ends = []
    for which in ("parent", "child"):
        end = reader.one(node, which)
        if end is None:
            raise reader.wrong(node.line, f"joint {name!r} has no <{which}>")
        link = reader.word(end, "link")
        if link not in links:
            raise reader.wrong(end.line, f"joint {name!r}: there is no link {link!r}")
        ends.append(link)
    kind = KINDS.get(kind, kind)
    locked = _locked(reader, node) if kind in ("turns", "slides") else None
    return _Joint(name, kind if locked is None else "fixed", ends[0], ends[1], node, locked)


def _locked(reader: UrdfReader, node: Node) -> float | None:
    """Return where a joint is that has nowhere to go [rad or m], None for one that moves.

    Exporters write zeros everywhere for limits that nobody set: that is no locked joint.
    """
    given = reader.one(node, "limit")
    if given is None or node.given["type"] == "continuous":
        return None
    if not {"lower", "upper"} <= given.given.keys():
        return None
    lower, upper = reader.bound(given, "lower", 0.0), reader.bound(given, "upper", 0.0)
    unset = lower == 0.0 and not any(
        reader.bound(given, key, 0.0) for key in ("effort", "velocity")
    )
    return lower if lower == upper and math.isfinite(lower) and not unset else None


def _origin(reader: UrdfReader, joint: _Joint) -> tuple[Vector, Matrix]:
    """Return where a joint's child is as the file has it, one that is locked where it is locked."""
    place, turn = reader.origin(joint.node)
    if not joint.locked:
        return place, turn
    moving = joint._replace(kind=KINDS[reader.word(joint.node, "type")], locked=None)
    shift, more = _held_at(reader, moving, joint.locked)
    return moved(turn, shift, place), times(turn, more)


def _check_in_chain(reader: UrdfReader, joint: _Joint) -> None:
    """Refuse a joint that no joint of a serial chain is."""
    name, line = joint.name, joint.node.line
    if joint.kind not in KINDS.values():
        known = ", ".join(KINDS)
        raise reader.wrong(
            line,
            f"joint {name!r} is {joint.kind}; a chain has {known} joints: if the arm stands on "
            f"link {joint.child!r}, state `base: {joint.child}`",
        )
    if joint.node.all("mimic"):
        raise reader.wrong(
            line,
            f"joint {name!r} mimics another, which a joint of the chain cannot; choose a tip "
            "before it, or make it fixed",
        )


def _route_to(path: Path, base: str, tip: str, above: Mapping[str, _Joint]) -> list[_Joint]:
    """Return the joints from a link to another that it carries."""
    route: list[_Joint] = []
    at = tip
    while at != base:
        if at not in above:
            raise ConfigError(f"{path}: link {base!r} does not carry the tip, {tip!r}")
        route.append(above[at])
        at = above[at].parent
    return route[::-1]


def _only_route(
    reader: UrdfReader, base: str, below: Mapping[str, list[_Joint]], moves: Mapping[str, bool]
) -> list[_Joint]:
    """Return the joints to the last that moves, in a file where no other moves beside them."""
    route: list[_Joint] = []
    at = base
    while moves[at]:
        moving = [joint for joint in below[at] if joint.kind != "fixed" or moves[joint.child]]
        if len(moving) > 1:
            why = f"joint {moving[1].name!r} branches off at link {at!r}"
            tips = _proposal(at, route, below, moving)
            raise reader.wrong(moving[1].node.line, f"{why}; {tips}")
        route.append(moving[0])
        at = moving[0].child
    return route


def _proposal(
    at: str, route: Sequence[_Joint], below: Mapping[str, list[_Joint]], moving: Sequence[_Joint]
) -> str:
    """Return which tips a file with branches has: before the first one, or on each of them."""
    if any(joint.kind != "fixed" for joint in route):
        return f"state the chain's end, such as `tip: {at}`; what is beyond is held"
    ends = []
    for joint in moving:
        end = joint.child
        while len(below[end]) == 1:
            end = below[end][0].child
        ends.append(end)
    return f"there is an arm on each branch: state the end of one, as `tip:` {' or '.join(ends)}"


def _body(
    reader: UrdfReader,
    links: Mapping[str, Node],
    below: Mapping[str, list[_Joint]],
    link: str,
    taken: set[str],
    held: Mapping[str, float],
    notes: list[str],
) -> Body:
    """Return a link's body with all that it carries beside the route, as it is held.

    What is impossible in a link beside the route is noted, and left out: its inertia, or its mass.
    """
    body = Body()
    todo: list[tuple[str, Vector, Matrix]] = [(link, ORIGIN, UNIT)]
    while todo:
        name, at, there = todo.pop()
        own = reader.body(links[name]) if name == link else reader.body(links[name], notes)
        body = joined(body, placed(own, there, at))
        for joint in below[name]:
            if joint.name not in taken:
                place, turn = _origin(reader, joint)
                shift, more = _held_at(reader, joint, held.get(joint.name, 0.0))
                place = moved(turn, shift, place)
                todo.append((joint.child, moved(there, place, at), times(there, times(turn, more))))
    return body


def _held_at(reader: UrdfReader, joint: _Joint, value: float) -> tuple[Vector, Matrix]:
    """Return where a joint's child is in the joint's frame: shift [m] and rotation."""
    if value == 0.0:
        return ORIGIN, UNIT
    _check_in_chain(reader, joint)
    x, y, z = _axis(reader, joint)
    if joint.kind == "slides":
        return (value * x, value * y, value * z), UNIT
    along = z_along((x, y, z))
    return ORIGIN, times(along, times(about_z(value), transposed(along)))


def _axis(reader: UrdfReader, joint: _Joint) -> Vector:
    given = reader.one(joint.node, "axis")
    x, y, z = reader.vector(given, "xyz", (1.0, 0.0, 0.0))
    size = math.hypot(x, y, z)
    if not 1e-6 < size < math.inf:
        line = joint.node.line if given is None else given.line
        raise reader.wrong(line, f"joint {joint.name!r}: its axis vector is zero or not finite")
    return x / size, y / size, z / size


def _limits(reader: UrdfReader, joint: _Joint) -> JointLimits:
    given, dynamics = reader.one(joint.node, "limit"), reader.one(joint.node, "dynamics")
    damping, friction = (
        0.0 if dynamics is None else max(reader.number(dynamics, key, 0.0), 0.0)
        for key in ("damping", "friction")
    )
    limits = JointLimits(joint.name, damping=damping, friction=friction)
    if given is None:
        return limits
    effort, velocity = (reader.bound(given, key, 0.0) or math.inf for key in ("effort", "velocity"))
    if joint.node.given["type"] == "continuous":
        return limits._replace(effort=effort, velocity=velocity)
    lower, upper = reader.bound(given, "lower", 0.0), reader.bound(given, "upper", 0.0)
    if lower > upper:
        raise reader.wrong(
            given.line,
            f"joint {joint.name!r}: its lower limit {lower:g} is above its upper {upper:g}",
        )
    if lower == upper:
        lower, upper = -math.inf, math.inf
    turns = max((abs(end) for end in (lower, upper) if math.isfinite(end)), default=0.0)
    if joint.kind == "turns" and turns > MOST_TURNED:
        raise reader.wrong(
            given.line,
            f"joint {joint.name!r}: its limits are {lower:g} to {upper:g} rad, "
            f"{turns / (2.0 * math.pi):.0f} turns: a URDF has radians, 3.14159 for 180 degrees; "
            "a joint that turns without an end is continuous",
        )
    return limits._replace(lower=lower, upper=upper, effort=effort, velocity=velocity)
