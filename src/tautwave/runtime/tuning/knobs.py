"""Knobs of a running controller: what may be turned, when, how far and how fast.

A wall's stiffness falls at any time, and what its spring then holds less is booked as dissipated;
it rises only out of the wall, where it costs nothing. A ceiling rises only while nothing is
clipped. Where both ends of a pair are clipped alike, the lower of both ceilings, as a share of its
limit, clips both from the same period on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from tautwave.runtime.control import Control


class Turning(NamedTuple):
    """How a knob acts: `turn(value)` sets it, `ready(value)` says whether it may go there now."""

    turn: Callable[[float], None]
    ready: Callable[[float], bool]


class Knob(NamedTuple):
    """One number that may be changed.

    `path` is its key in the rig, `column` its column in the recording; `value`, `low`, `high` are
    in `unit`; `when` as the key declares it. `ramped`: it goes there in steps.
    """

    path: str
    column: str
    unit: str
    when: str
    value: float
    low: float
    high: float
    turning: Turning
    ramped: bool = True


def wall_knob(control: Control, which: int, key: str) -> Turning:
    """Return how `stiffness`, `damping` or `position` of an axis' wall is turned."""

    def turn(value: float) -> None:
        p, s = control.params[which], control.axis(which)
        wall = p.site.wall
        if key == "stiffness":
            s.wall_dissipated += 0.5 * (wall.stiffness - value) * s.depth * s.depth
        changed: Any = {key: value}
        control.retune(which, p._replace(site=p.site._replace(wall=wall._replace(**changed))))

    def ready(value: float) -> bool:
        if key == "position":
            return not control.engaged
        wall = control.params[which].site.wall
        return key == "damping" or value <= wall.stiffness or control.axis(which).depth == 0.0

    return Turning(turn, ready)


def ceiling_knob(control: Control, which: int, alike: Sequence[int] = ()) -> Turning:
    """Return how the greatest effort of wall and coupling at an axis is turned.

    `alike`: the ends of its pair, where both are clipped alike.
    """
    whole = {end: (control.params[end].ceiling, control.params[end].site.clip) for end in alike}

    def turn(value: float) -> None:
        control.retune(which, control.params[which]._replace(ceiling=value))
        share = min((control.params[end].ceiling / whole[end][0] for end in alike), default=1.0)
        for end in alike:
            p = control.params[end]
            control.retune(end, p._replace(site=p.site._replace(clip=share * whole[end][1])))

    def ready(value: float) -> bool:
        if value <= control.params[which].ceiling:
            return True
        for end in alike or (which,):
            s, p = control.axis(end), control.params[end]
            if s.depth != 0.0 or math.fabs(s.asked) > min(p.ceiling, p.site.clip):
                return False
        return True

    return Turning(turn, ready)


def coupling_knob(
    control: Control,
    whiches: tuple[int, int],
    tune: Callable[[Any, Any, str, float, float], Any],
    key: str,
) -> Turning:
    """Return how a key of a pair's coupling is turned at both its ends."""

    def turn(value: float) -> None:
        for which in whiches:
            p = control.params[which]
            end = tune(p.end, control.axis(which).end, key, value, p.site.period)
            control.retune(which, p._replace(end=end))

    return Turning(turn, lambda value: True)
