"""Arms as a page draws them while they move: points of their chains, forces, walls in space."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

from tautwave.config import Rig
from tautwave.errors import TautwaveError
from tautwave.report.arms.parts import ArmParts, Point, arm_parts, arm_points

FLAT = 1e-6
"""Of its reach, what an arm may leave a plane by and is still seen from above alone."""


class Drawn:
    """The arms of a rig, posed by rows; none where their chains cannot be read.

    Parameters
    ----------
    columns : sequence of str
        Of a row; arms whose joints are another site's are left out.
    rig : Rig
        The rig.
    """

    def __init__(self, columns: Sequence[str], rig: Rig) -> None:
        at = {name: k for k, name in enumerate(columns)}
        try:
            arms = [arm for arm in arm_parts(rig) if set(arm.joints) <= set(at)]
        except TautwaveError:
            arms = []
        self._arms = arms
        self._joints = [[at[name] for name in arm.joints] for arm in arms]
        self._forces = [
            {
                name: [(at[c.column], c.axis, c.factor) for c in parts if c.column in at]
                for name, parts in arm.forces.items()
            }
            for arm in arms
        ]
        self._points = [arm_points(arm.chain, [0.0] * len(arm.joints)) for arm in arms]

    def facts(self) -> list[dict[str, Any]]:
        """Return what does not move: names, sides, reach [m], walls in the arm's base [m]."""
        return [
            {
                "name": arm.name,
                "side": arm.side,
                "reach": _reach(points),
                "flat": _flat(arm),
                "walls": _walls(arm, points),
            }
            for arm, points in zip(self._arms, self._points, strict=True)
        ]

    def pose(self, row: Sequence[float]) -> list[dict[str, Any]]:
        """Return points [m] and forces [N] at a row; one without a sample repeats the last."""
        pieces = []
        for k, arm in enumerate(self._arms):
            posture = [row[at] for at in self._joints[k]]
            if all(math.isfinite(q) for q in posture):
                self._points[k] = arm_points(arm.chain, posture)
            forces = {}
            for name, parts in self._forces[k].items():
                along = [0.0, 0.0, 0.0]
                for at, axis, factor in parts:
                    along[axis] = factor * row[at] if math.isfinite(row[at]) else 0.0
                x, y, z = zip(*arm.frame, strict=True)
                forces[name] = [_dot(along, x), _dot(along, y), _dot(along, z)]
            pieces.append({"points": self._points[k], "forces": forces})
        return pieces


def _dot(one: Sequence[float], other: Sequence[float]) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _reach(points: Sequence[Point]) -> float:
    return sum(math.dist(one, other) for one, other in itertools.pairwise(points))


def _flat(arm: ArmParts) -> bool:
    """Return whether no joint leaves the base's horizontal plane."""
    joints = len(arm.joints)
    postures = ([0.0] * joints, [0.4 + 0.3 * k for k in range(joints)])
    high = [z for q in postures for _, _, z in arm_points(arm.chain, q)]
    return max(high) - min(high) <= FLAT * _reach(arm_points(arm.chain, postures[0]))


def _walls(arm: ArmParts, points: Sequence[Point]) -> dict[str, Any]:
    """Return the lines and patches of walls, by name; each is a list of points [m]."""
    if not arm.walls:
        return {}
    import numpy as np

    from tautwave.report.arms.solids import wires_of

    frame, reach, tip = np.array(arm.frame), _reach(points), np.array(points[-1])
    outlines = {}
    for name, wall in arm.walls.items():
        lines, patches = wires_of(wall, frame, reach, tip)
        outlines[name] = {
            "lines": [line.tolist() for line in lines],
            "patches": [patch.tolist() for patch in patches],
        }
    return outlines
