"""Knobs of a running controller: what may be turned, when, how far and how fast.

A wall's stiffness falls at any time, and what its spring then holds less is booked as dissipated;
it rises only out of the wall, where it costs nothing. A ceiling rises only while nothing is
clipped.
"""

from __future__ import annotations

import math
from collections.abc import Callable
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


def ceiling_knob(control: Control, which: int) -> Turning:
    """Return how the greatest effort of wall and coupling at an axis is turned."""

    def turn(value: float) -> None:
        control.retune(which, control.params[which]._replace(ceiling=value))

    def ready(value: float) -> bool:
        s, ceiling = control.axis(which), control.params[which].ceiling
        return value <= ceiling or (s.depth == 0.0 and math.fabs(s.asked) <= ceiling)

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
