"""From a row to what ROS users expect of a device: joint states, and the wrench at a tip."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from tautwave.config import Rig
from tautwave.view.ros.messages import Header, JointState, Time, Vector3, Wrench, WrenchStamped

SIDES = ("master", "slave")
NAN = math.nan
NOWHERE = -1
"""In place of a column that a rig does not have."""

TRIPLES = ((1, 2, 3), (4, 5, 6))
"""Numbers of an arm's coordinates: x, y, z of the tip, and its rotation vector."""


class Joints(NamedTuple):
    """Columns of the joints of one side, by place; `valid` are 0 where a sample is missing."""

    names: Sequence[str]
    position: Sequence[int]
    velocity: Sequence[int]
    effort: Sequence[int]
    valid: Sequence[int]


class Tip(NamedTuple):
    """Columns at an arm's tip, by place: efforts on its coordinates, turns, forces of walls."""

    force: Sequence[int]
    turn: Sequence[int]
    torque: Sequence[int]
    walls: Sequence[Sequence[int]]
    valid: Sequence[int]


def stamp(time_s: float, epoch_ns: int) -> Time:
    """Return a time of the run as wall time, mapped once, when the recording began."""
    return Time(*divmod(epoch_ns + round(1e9 * time_s), 1_000_000_000))


def joints_of(columns: Sequence[str], rig: Rig) -> dict[str, Joints]:
    """Return the joints of each side that this run records.

    Those of an arm are its joints, not the coordinates of its tip.
    """
    at = {name: k for k, name in enumerate(columns)}
    joints = {}
    for side in SIDES:
        rows, valid = [], []
        for name in _axes(rig, side):
            axis = rig.axes[f"{side}.{name}"]
            if f"{side}.{name}.position" not in at:
                continue
            valid.append(at[f"{side}.{name}.valid"])
            measured = axis.causality == "admittance"  # it takes a velocity
            effort = "measured_effort" if measured else "commanded"
            if rig.buses[axis.bus].driver != "arm":
                rows.append((name, *_places(at, f"{side}.{name}", effort)))
        rows += [
            (name, *_places(at, f"joints.{side}.{name}", "effort"))
            for name in filter(None, (_joint(column, side) for column in columns))
        ]
        if rows:
            names, position, velocity, effort_at = zip(*rows, strict=True)
            joints[side] = Joints(names, position, velocity, effort_at, valid)
    return joints


def _axes(rig: Rig, side: str) -> list[str]:
    return [name.partition(".")[2] for name in rig.axes if name.startswith(f"{side}.")]


def _joint(column: str, side: str) -> str:
    match = re.fullmatch(rf"joints\.{side}\.(.+)\.position", column)
    return match[1] if match else ""


def _places(at: Mapping[str, int], stem: str, effort: str) -> tuple[int, int, int]:
    leaves = ("position", "velocity", effort)
    position, velocity, effort_at = (at.get(f"{stem}.{leaf}", NOWHERE) for leaf in leaves)
    return position, velocity, effort_at


def tips_of(columns: Sequence[str], rig: Rig) -> dict[str, Tip]:
    """Return the tip of each side whose axes are the coordinates of one."""
    at = {name: k for k, name in enumerate(columns)}
    tips = {}
    for side in SIDES:
        names = {
            axis.id: name
            for name, axis in (
                (f"{side}.{one}", rig.axes[f"{side}.{one}"]) for one in _axes(rig, side)
            )
            if rig.buses[axis.bus].driver == "arm" and f"{name}.position" in at
        }
        if not names:
            continue
        bus = re.escape(rig.axes[next(iter(names.values()))].bus)
        walls = [c[:-3] for c in columns if re.fullmatch(rf"space\.{bus}\..+\.fx", c)]
        force, torque = (
            [at[f"{names[k]}.commanded"] if k in names else NOWHERE for k in triple]
            for triple in TRIPLES
        )
        tips[side] = Tip(
            force,
            [at[f"{names[k]}.position"] if k in names else NOWHERE for k in TRIPLES[1]],
            torque,
            [[at[f"{wall}.f{axis}"] for axis in "xyz"] for wall in walls],
            [at[f"{name}.valid"] for name in names.values()],
        )
    return tips


def whole(row: Sequence[float], valid: Sequence[int]) -> bool:
    """Return whether a row has a sample of all of them."""
    return all(row[k] for k in valid)


def joint_state(joints: Joints, row: Sequence[float], at: Time) -> JointState:
    """Return a row's joints; NaN where a joint has no such column, nothing where none has it."""
    velocity, effort = (
        [] if all(k < 0 for k in places) else _values(row, places, NAN)
        for places in (joints.velocity, joints.effort)
    )
    position = _values(row, joints.position, NAN)
    return JointState(Header(at, ""), list(joints.names), position, velocity, effort)


def _values(row: Sequence[float], places: Sequence[int], missing: float) -> list[float]:
    return [row[k] if k >= 0 else missing for k in places]


def wrench(tip: Tip, row: Sequence[float], at: Time, frame: str) -> WrenchStamped:
    """Return what the motors do to the tip for coupling and walls, in the coordinates' frame.

    The weight that they carry besides is not in it. Torque is NaN where only some of the
    rotation's coordinates are axes.
    """
    force = _values(row, tip.force, 0.0)
    for wall in tip.walls:
        force = [total + row[k] for total, k in zip(force, wall, strict=True)]
    known = [k >= 0 for k in tip.turn]
    torque = (NAN, NAN, NAN) if any(known) else (0.0, 0.0, 0.0)
    if all(known):
        torque = torque_of(_values(row, tip.turn, NAN), _values(row, tip.torque, NAN))
    return WrenchStamped(Header(at, frame), Wrench(Vector3(*force), Vector3(*torque)))


def torque_of(turn: Sequence[float], effort: Sequence[float]) -> tuple[float, float, float]:
    """Return the torque [N m] that does the power of efforts on a rotation vector.

    `turn` r [rad] turns at w = J(r) dr/dt, J the left Jacobian of SO(3), so that efforts e are
    those of the torque J^-T e = e + r x e / 2 + c r x (r x e).

    Source: Chirikjian, Stochastic Models, Information Theory, and Lie Groups 2 (2012), 10.7.
    """
    angle2 = sum(r * r for r in turn)
    c = 1.0 / 12.0
    if angle2 > 1e-8:
        angle = math.sqrt(angle2)
        c = (1.0 - 0.5 * angle / math.tan(0.5 * angle)) / angle2
    once = _cross(turn, effort)
    twice = _cross(turn, once)
    x, y, z = (e + 0.5 * o + c * t for e, o, t in zip(effort, once, twice, strict=True))
    return x, y, z


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
