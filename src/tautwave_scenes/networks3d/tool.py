"""Rigid tools: points that a device's axes move and turn as one body.

To the network each point is a port with three coordinates. A tool stands at its offset plus what
its axes move it by, turned by the rotation vector that its turning axes add up to, as the
coordinates rx, ry and rz of the driver `arm` do. With r the way from the tool's place to a point
and f the force there, a device feels the wrench (sum f, sum r x f). Angular velocity is the
rotation vector's rate times a matrix D, so the turning axes bear D^T (sum r x f), and at any pose
effort times speed of all axes is wrench . twist = sum f . v, to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

Vector = tuple[float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]
SMALL = 1e-4
"""Angle [rad] below which series take the place of quotients."""


class Tool3d(NamedTuple):
    """A rigid tool between axes of a device and its points.

    `ways` are the directions in which `axes` move it, `about` the parts of the rotation vector that
    each of `turns` adds (unit vectors); `points` are names of ports and where they are in the
    tool's axes [m].
    """

    name: str
    axes: tuple[str, ...]
    ways: tuple[Vector, ...]
    turns: tuple[str, ...]
    about: tuple[Vector, ...]
    points: tuple[tuple[str, Vector], ...]


class Pose(NamedTuple):
    """Of a tool: the matrix D, and the ways from its place to its points in the scene [m]."""

    rate: Matrix
    arms: tuple[Vector, ...]


def turn_of(v: Vector) -> tuple[Matrix, Matrix]:
    """Return the rotation by a rotation vector [rad], and D: its angular velocity per rate of v.

    With K the cross product with v and t its length both are 1 + a K + b K^2 (Rodrigues): a and b
    are sin t / t and (1 - cos t) / t^2 of the rotation, (1 - cos t) / t^2 and (t - sin t) / t^3 of
    D.
    """
    square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
    t = math.sqrt(square)
    first, second, third = 1.0 - square / 6.0, 0.5 - square / 24.0, (1.0 - square / 20.0) / 6.0
    if t > SMALL:
        half = math.sin(0.5 * t) / t  # 1 - cos t would lose digits
        first, second = math.sin(t) / t, 2.0 * half * half
        third = (1.0 - first) / square
    return _power(v, square, first, second), _power(v, square, second, third)


def _power(v: Vector, square: float, a: float, b: float) -> Matrix:
    """Return 1 + a K + b K^2; K^2 is v v^T less the square of v's length."""
    x, y, z = v
    own = 1.0 - b * square
    return (
        own + b * x * x,
        b * x * y - a * z,
        b * x * z + a * y,
        b * x * y + a * z,
        own + b * y * y,
        b * y * z - a * x,
        b * x * z - a * y,
        b * y * z + a * x,
        own + b * z * z,
    )


def times(m: Matrix, v: Vector) -> Vector:
    """Return a matrix times a vector."""
    x, y, z = v
    return (
        m[0] * x + m[1] * y + m[2] * z,
        m[3] * x + m[4] * y + m[5] * z,
        m[6] * x + m[7] * y + m[8] * z,
    )


def place_tool(tool: Tool3d, at: Sequence[float]) -> tuple[Pose, list[float]]:
    """Return a tool's pose, and by how much each of its points is away from its start [m].

    Parameters
    ----------
    tool : Tool3d
        The tool.
    at : sequence of float
        Positions of its axes [m], then of its turning axes [rad].
    """
    moved = _sum(at, tool.ways)
    rotation, rate = turn_of(_sum(at[len(tool.ways) :], tool.about))
    arms = tuple(times(rotation, where) for _, where in tool.points)
    away = [
        shift + (now - start)
        for arm, (_, where) in zip(arms, tool.points, strict=True)
        for shift, now, start in zip(moved, arm, where, strict=True)
    ]
    return Pose(rate, arms), away


def _sum(shares: Sequence[float], ways: Sequence[Vector]) -> Vector:
    x = y = z = 0.0
    for share, way in zip(shares, ways, strict=False):
        x += share * way[0]
        y += share * way[1]
        z += share * way[2]
    return x, y, z


def wrench_of(pose: Pose, forces: Sequence[float]) -> tuple[Vector, Vector]:
    """Return force [N] and moment about the tool's place [N m] of forces on its points [N]."""
    fx = fy = fz = mx = my = mz = 0.0
    for j, (x, y, z) in enumerate(pose.arms):
        px, py, pz = forces[3 * j : 3 * j + 3]
        fx, fy, fz = fx + px, fy + py, fz + pz
        mx, my, mz = mx + (y * pz - z * py), my + (z * px - x * pz), mz + (x * py - y * px)
    return (fx, fy, fz), (mx, my, mz)


def tool_efforts(tool: Tool3d, pose: Pose, forces: Sequence[float]) -> list[float]:
    """Return the efforts on a tool's axes [N], then on its turning axes [N m], of forces on it."""
    force, moment = wrench_of(pose, forces)
    d = pose.rate
    turning = times((d[0], d[3], d[6], d[1], d[4], d[7], d[2], d[5], d[8]), moment)
    efforts = [w[0] * force[0] + w[1] * force[1] + w[2] * force[2] for w in tool.ways]
    return efforts + [w[0] * turning[0] + w[1] * turning[1] + w[2] * turning[2] for w in tool.about]


class Carried:
    """What lies between a device's axes and the coordinates of a network's ports.

    Parameters
    ----------
    parts : sequence of (int, Tool3d or None)
        In the order of the ports: axes of a port that none carries, or a tool with all its points.
    """

    def __init__(self, parts: Sequence[tuple[int, Tool3d | None]]) -> None:
        self._parts = parts
        self._poses: list[Pose] = []

    def spread(self, positions: Sequence[float]) -> list[float]:
        """Return the ports' coordinates with the axes at `positions` [m or rad]."""
        out: list[float] = []
        self._poses = []
        first = 0
        for count, tool in self._parts:
            own = positions[first : first + count]
            first += count
            if tool is not None:
                pose, own = place_tool(tool, own)
                self._poses.append(pose)
            out += own
        return out

    def gather(self, efforts: Sequence[float]) -> list[float]:
        """Return the efforts on the axes, of those on the coordinates where `spread` put them."""
        out: list[float] = []
        first = 0
        poses = iter(self._poses)
        for count, tool in self._parts:
            size = count if tool is None else 3 * len(tool.points)
            own = efforts[first : first + size]
            first += size
            out += own if tool is None else tool_efforts(tool, next(poses), own)
        return out
