"""Planes of stiffness over damping, period, delay or mass: passive, stable, unstable, simulated.

Each column of a plane is a wall on a device; its stiffness is varied. Three limits belong to it,
and they are never mixed: the greatest passive stiffness (for every user, proved), the greatest
coupled-stable one (for this device and hand, from the exact loop) and where the simulator's own
one-period map begins to grow. The disagreement of the last two is a number.

Sources: Colgate & Brown, ICRA 1994 (the plane); `tautwave.analysis.walls.limits`,
`tautwave.analysis.walls.stability`, `tautwave.analysis.maps.simulated`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.maps.simulated import simulated_growths
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import StableRange, stable_stiffness
from tautwave.errors import ConfigError

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

ROUNDS = 30
"""Bisections of a simulated boundary: a grid step comes down to a billionth of itself."""


class Column(NamedTuple):
    """One column: a wall whose stiffness is varied, the device with its hand, and its x.

    `own_damping` is what passivity may count on: that of the device without the hand. `coulomb`
    [N or N m] and the encoder step `quantum` [m or rad] count only in
    `tautwave.analysis.maps.quantised`.
    """

    x: float
    wall: SampledWall
    device: Device
    own_damping: float
    coulomb: float = 0.0
    quantum: float = 0.0


class StabilityPlane(NamedTuple):
    """Limits and verdicts over columns (c) and stiffnesses (k).

    Attributes
    ----------
    x, stiffness : arrays of shape (c,) and (k,)
        Axes; stiffness [N/m or N m/rad].
    passive, stable : arrays of shape (c,)
        Greatest passive and coupled-stable stiffness; 0 where none is, inf where all are.
    simulated : array of shape (c,)
        First stiffness at which the simulated map begins to grow, nan where that is outside the
        plane.
    growth : array of shape (k, c)
        Simulated growth ln|z| per period.
    predicted : array of shape (k, c)
        Whether the exact loop is stable there.
    edges : tuple of (x, simulated, predicted)
        Every simulated change of the verdict beside the predicted one.
    """

    x: Floats
    stiffness: Floats
    passive: Floats
    stable: Floats
    simulated: Floats
    growth: Floats
    predicted: Flags
    edges: tuple[tuple[float, float, float], ...]

    @property
    def mismatched(self) -> int:
        """Points at which prediction and simulation differ."""
        return int(np.sum(self.predicted != (self.growth <= GROWING)))

    @property
    def disagreement(self) -> float:
        """Greatest relative distance of a simulated boundary from the predicted one [1]."""
        return max(
            (abs(simulated / predicted - 1.0) for _, simulated, predicted in self.edges),
            default=0.0,
        )


GROWING = 1e-13
"""Growth per period above which a simulated map counts as unstable: rounding of its roots."""


def stability_plane(
    columns: Sequence[Column],
    stiffness: Floats,
    progress: Callable[[float], None] | None = None,
) -> StabilityPlane:
    """Return all three limits, and the simulated verdict at every point.

    Parameters
    ----------
    columns : sequence of Column
        From left to right.
    stiffness : array of shape (k,)
        Rising, above 0 [N/m or N m/rad].
    progress : callable, optional
        Called with the share done.

    Raises
    ------
    ConfigError
        No columns, or stiffnesses that do not rise from above 0.
    """
    if not columns or len(stiffness) < 2 or stiffness[0] <= 0.0 or np.any(np.diff(stiffness) <= 0):
        raise ConfigError("a plane needs columns, and stiffnesses that rise from above 0")
    passive, stable, simulated = [], [], []
    growths, predicted = [], []
    edges: list[tuple[float, float, float]] = []
    for at, column in enumerate(columns):
        delay = column.wall.delay + column.device.command_delay
        passive.append(greatest_stiffness(column.wall._replace(delay=delay), column.own_damping))
        limit = stable_stiffness(column.wall, column.device)
        stable.append(limit.limit)
        predicted.append(_within(limit, stiffness))
        growth = simulated_growths(column.wall, column.device, stiffness)
        growths.append(growth)
        places = _changes(column, stiffness, growth <= GROWING)
        simulated.append(places[0] if places and growth[0] <= GROWING else math.nan)
        ends = [end for band in limit.bands for end in band if 0.0 < end < math.inf]
        edges += [(column.x, place, _nearest(place, ends)) for place in places if ends]
        if progress is not None:
            progress((at + 1) / len(columns))
    return StabilityPlane(
        np.array([column.x for column in columns]),
        stiffness,
        np.array(passive),
        np.array(stable),
        np.array(simulated),
        np.array(growths).T,
        np.array(predicted).T,
        tuple(edges),
    )


def vary(column: Column, key: str, value: float, *, keep_delay_s: bool = False) -> Column:
    """Return a column with one thing changed; its x becomes `value`.

    Parameters
    ----------
    column : Column
        What stays.
    key : str
        `wall_damping`, `period_s`, `delay_periods`, `mass`, `damping` (of the device; the hand's
        part stays), `coulomb` or `quantum`.
    value : float
        SI.
    keep_delay_s : bool
        With `period_s`: the delay stays as it is in seconds, else in periods.
    """
    wall, device, own = column.wall, column.device, column.own_damping
    coulomb, quantum = column.coulomb, column.quantum
    if key == "wall_damping":
        wall = wall._replace(damping=value)
    elif key == "period_s":
        if keep_delay_s:
            share = wall.period / value
            wall = wall._replace(delay=wall.delay * share)
            device = device._replace(command_delay=device.command_delay * share)
        wall = wall._replace(period=value)
    elif key == "delay_periods":
        wall, device = wall._replace(delay=value), device._replace(command_delay=0.0)
    elif key == "mass":
        device = device._replace(mass=value)
    elif key == "damping":
        device = device._replace(damping=device.damping - own + value)
        own = value
    elif key == "coulomb":
        coulomb = value
    elif key == "quantum":
        quantum = value
    else:
        raise ConfigError(f"{key!r} cannot be varied in a plane")
    return Column(value, wall, device, own, coulomb, quantum)


def _within(found: StableRange, stiffness: Floats) -> Flags:
    inside = np.zeros(len(stiffness), np.bool_)
    for low, high in found.bands:
        inside |= (stiffness >= low) & (stiffness <= high)
    return inside


def _nearest(place: float, ends: Sequence[float]) -> float:
    return min(ends, key=lambda end: abs(end - place))


def _changes(column: Column, stiffness: Floats, stable: Flags) -> list[float]:
    """Return every stiffness at which the simulated verdict changes, bisected."""
    places = []
    for at in np.flatnonzero(stable[1:] != stable[:-1]):
        low, high = float(stiffness[at]), float(stiffness[at + 1])
        for _ in range(ROUNDS):
            middle = 0.5 * (low + high)
            fine = simulated_growths(column.wall, column.device, [middle])[0] <= GROWING
            if fine == stable[at]:
                low = middle
            else:
                high = middle
        places.append(0.5 * (low + high))
    return places
