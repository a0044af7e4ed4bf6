"""The local walls of a rig, by axis."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.config.keys.coupling import Wall
from tautwave.config.keys.rig import Rig


def local_wall(rig: Rig, axis_name: str) -> Wall | None:
    """Return the local wall of an axis such as `master.wrist`, None without one."""
    side, pair = axis_name.split(".")
    if rig.scene is not None:
        return None  # its contacts are links
    keys = rig.coupling.pairs[pair]
    return keys.wall_master if side == "master" else keys.wall_slave


def replace_wall(rig: Rig, axis_name: str, wall: Wall) -> Rig:
    """Return a rig with a different wall at an axis."""
    side, name = axis_name.split(".")
    pair = rig.coupling.pairs[name].model_copy(update={f"wall_{side}": wall})
    coupling = rig.coupling.model_copy(update={"pairs": {**rig.coupling.pairs, name: pair}})
    return rig.model_copy(update={"coupling": coupling})


def render_stiffness(rig: Rig, stiffness: Mapping[str, float]) -> Rig:
    """Return a rig whose walls have these stiffnesses by axis [N m/rad or N/m]."""
    for axis_name, value in stiffness.items():
        wall = local_wall(rig, axis_name)
        if wall is not None and value != wall.stiffness:
            rig = replace_wall(rig, axis_name, wall.model_copy(update={"stiffness": value}))
    return rig
