"""Constant shares of a motor, where a spring and a wall act on it without an account.

A spring whose ends are clipped at one constant cannot be carried around and let go for nothing. At
what either motor has left at the moment it can: it is stretched where a wall leaves little, and let
go where the wall leaves all. So both ends of a pair are clipped at what the weaker one is sure to
have, and its wall at its own share. Friction that is compensated needs no share: where it is cut,
less of it is.
"""

from __future__ import annotations

import math

from tautwave.config import Rig, local_wall
from tautwave.errors import ConfigError
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.scales import pair_scale
from tautwave.types import CommandDelay

AT_ONCE = CommandDelay(0, 0.0)
"""Shares of effort do not depend on when commands act."""


def certain_effort(rig: Rig, axis_name: str) -> float:
    """Return what the coupling of an axis is sure to have [N m or N].

    Raises
    ------
    ConfigError
        Its wall or what takes inertia off leaves nothing.
    """
    has = axis_allowance(rig, axis_name, AT_ONCE)
    left = has.shared_effort - has.wall_effort - has.lift_effort
    if left > 0.0:
        return left
    side, name = axis_name.split(".")
    takes = f"{has.wall_effort:g} of it is reserved for its wall"
    key = f"coupling.pairs.{name}.wall_{side}.effort_limit"
    if has.lift_effort > 0.0:
        takes += f" and {has.lift_effort:g} take inertia off"
        key += f" or {side}.axes.{name}.compensation.inertia"
    raise ConfigError(
        f"{axis_name}: nothing is left for its coupling of the {has.shared_effort:g} that its "
        f"motor has beside a load: {takes}; lower {key}"
    )


def pair_clip(rig: Rig, pair: str) -> float:
    """Return the greatest effort that both ends of a spring may send [N m or N, master]."""
    master, slave = (certain_effort(rig, f"{side}.{pair}") for side in ("master", "slave"))
    return min(master, slave / pair_scale(rig.coupling.pairs[pair]).force_scale)


def clips(rig: Rig, axis_name: str, *, alike: bool) -> tuple[float, float]:
    """Return what coupling and wall of an axis are clipped at, each by itself [N m or N].

    `alike`: the coupling is a spring that both ends send alike. Infinite: by the axis' limits.
    """
    side, pair = axis_name.split(".")
    wall = local_wall(rig, axis_name)
    if not alike:
        own = None if wall is None else wall.effort_limit
        return math.inf, math.inf if own is None else own
    clip = pair_clip(rig, pair)
    if side == "slave":
        clip *= pair_scale(rig.coupling.pairs[pair]).force_scale
    return clip, math.inf if wall is None else axis_allowance(rig, axis_name, AT_ONCE).wall_effort
