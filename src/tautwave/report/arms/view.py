"""Arms as the report sees them: where their joints were, what was at their tips; SI units."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.errors import TautwaveError
from tautwave.models.chain.params import ChainParams
from tautwave.report.arms.parts import ArmParts, arm_parts, arm_points
from tautwave.report.arms.solids import Wire, wires_of
from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import Run

DRAWN = 720
"""Rows of a run at which arms are drawn: points of their tips' ways."""

AZIMUTH, ELEVATION = math.radians(-55.0), math.radians(22.0)


class ArmView(NamedTuple):
    """One arm over the drawn rows.

    Attributes
    ----------
    name : str
        `master`, `slave`, of several arms the full name, or the bus of a tip.
    side : str
        `master` or `slave`.
    joints : (rows, joints + 2, 3)
        Base, origins of the joints' frames, tip [m].
    forces : dict of str to (rows, 3)
        On the tip by what exerts it [N], in base axes: `coupling` and walls in space.
    walls : dict of str to Wire
        Outlines of walls in space, in base axes [m].
    """

    name: str
    side: str
    joints: Floats
    forces: dict[str, Floats]
    walls: dict[str, Wire]

    @property
    def flat(self) -> bool:
        """Whether it moves in a horizontal plane, and is seen from above."""
        high = np.ptp(self.joints[:, :, 2])
        return bool(high < 1e-6 * max(float(np.ptp(self.joints[:, :, :2])), 1e-12))

    def seen(self, places: Floats) -> Floats:
        """Return (..., 3) as right, up, nearness [m]: from above, or obliquely."""
        x, y, z = places[..., 0], places[..., 1], places[..., 2]
        if self.flat:
            return np.stack([x, y, z], axis=-1)
        across = math.cos(AZIMUTH) * y - math.sin(AZIMUTH) * x
        near = math.cos(AZIMUTH) * x + math.sin(AZIMUTH) * y
        high = math.cos(ELEVATION) * z - math.sin(ELEVATION) * near
        depth = math.cos(ELEVATION) * near + math.sin(ELEVATION) * z
        return np.stack([across, high, depth], axis=-1)


class ArmsView(NamedTuple):
    """All arms of a run at the drawn rows: `time` [s], `liveliest` is where most force was."""

    time: Floats
    arms: Sequence[ArmView]
    liveliest: int


def view_arms(run: Run) -> ArmsView | None:
    """Return the arms of a run, None if it has none or they were not recorded."""
    if run.rows < 2 or "scene" in run.rig:
        return None
    try:
        rig = run.checked_rig
        rows = np.unique(np.linspace(0, run.rows - 1, DRAWN).astype(int))
        seen = (_view(run, arm, rows) for arm in arm_parts(rig))
        arms = [view for view in seen if view is not None]
    except TautwaveError:
        return None
    if not arms:
        return None
    size = np.zeros(len(rows))
    for arm in arms:
        for force in arm.forces.values():
            size += np.nan_to_num(np.linalg.norm(force, axis=1))
    spent = size if size.any() else np.linalg.norm(arms[0].joints[:, -1], axis=1)
    return ArmsView(run.read("time_s")["time_s"][rows], arms, int(np.argmax(spent)))


def _view(run: Run, arm: ArmParts, rows: Any) -> ArmView | None:
    q = _columns(run, arm.joints, rows)
    if q is None:
        return None
    frame = np.array(arm.frame)
    forces = {}
    for name, components in arm.forces.items():
        along = np.zeros((len(rows), 3))
        known = False
        for column, axis, factor in components:
            series = _columns(run, [column], rows)
            if series is not None:
                along[:, axis] = factor * series[:, 0]
                known = True
        if known or name == "coupling":
            forces[name] = along @ frame
    joints = _places(arm.chain, q)
    reach = float(np.abs(joints - joints[:, :1]).max())
    near = joints[:, -1].mean(axis=0)
    walls = {key: wires_of(wall, frame, reach, near) for key, wall in arm.walls.items()}
    return ArmView(arm.name, arm.side, joints, forces, walls)


def _columns(run: Run, names: Sequence[str], rows: Any) -> Floats | None:
    series = [run.read(name).get(name) for name in names]
    known = [values[rows] for values in series if values is not None]
    return np.stack(known, axis=1) if known and len(known) == len(names) else None


def _places(chain: ChainParams, q: Floats) -> Floats:
    """Return base, joints and tip at every row; a row without a sample repeats the one before."""
    places = np.zeros((len(q), q.shape[1] + 2, 3))
    for row, posture in enumerate(q.tolist()):
        if all(math.isfinite(at) for at in posture):
            places[row] = arm_points(chain, posture)
        else:
            places[row] = places[row - 1]
    return places
