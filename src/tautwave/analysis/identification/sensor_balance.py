"""Offset and scale of an effort sensor against the motor, where the device stands still.

A device at rest balances: the effort F from outside and the motor's u differ by less than its
friction, |F + u| <= c. A sensor shows s = o + k F, +- n. So every rest i bounds (o, k),

    s_i - n_i + k (u_i - c)  <=  o  <=  s_i + n_i + k (u_i + c),

and two rests bound k alone: k (u_i - u_j - 2 c) <= s_j - s_i + n_i + n_j. What is returned is the
whole set that the rests allow, not an estimate of it: an offset or a scale outside of it is wrong,
if the friction is no greater than stated. The offset's interval is that at the scale nearest to 1.

Source: bounded-error estimation (Milanese & Vicino, Automatica 27(6), 1991); the bounds are derived
here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

DEVIATIONS = 4.0

SURELY = 1.5
"""Times the friction believed in, what a device at rest may hold at most."""

MIN_SHARE = 0.02
"""Of the effort limit, what it may hold at least, whatever is assumed."""


class Interval(NamedTuple):
    """What is possible; `middle` of it where it is bounded."""

    lower: float
    upper: float

    def __contains__(self, value: object) -> bool:
        """Return whether a number is possible."""
        return isinstance(value, int | float) and self.lower <= value <= self.upper

    @property
    def middle(self) -> float:
        """The number that is farthest from both ends."""
        return 0.5 * (self.lower + self.upper)


class Rests(NamedTuple):
    """Where a device stood still: what its sensor showed, +- `doubt`, and its motor's effort."""

    shown: Floats
    doubt: Floats
    motor: Floats


class SensorBalance(NamedTuple):
    """What the rests allow: the offset [N m or N] at a scale, and the scale [1]."""

    offset: Interval
    scale: Interval
    at: float
    rests: int


def most_at_rest(coulomb: float, effort_limit: float) -> float:
    """Return the greatest friction of a device at rest, from the assumed values [N m or N]."""
    return max(SURELY * coulomb, MIN_SHARE * effort_limit)


def find_rests(
    position: Floats, motor: Floats, shown: Floats, *, window: int, play: float, quantum: float
) -> Rests:
    """Return the windows in which a device stood still.

    Parameters
    ----------
    position, motor, shown : arrays, (n,)
        Measured position [rad or m], motor's effort and what a sensor shows [N m or N].
    window : int
        Samples of a window.
    play : float
        How far positions of a device at rest lie apart [rad or m]: steps and noise.
    quantum : float
        Step of what is shown [N m or N].
    """
    rows = list(_still(position, motor, shown, window, play, quantum))
    windows = np.array(rows, dtype=np.float64).reshape(len(rows), 3)
    return Rests(windows[:, 0], windows[:, 1], windows[:, 2])


def _still(
    position: Floats, motor: Floats, shown: Floats, window: int, play: float, quantum: float
) -> Iterator[tuple[float, float, float]]:
    for first in range(0, len(position) - window + 1, window):
        part = slice(first, first + window)
        if not np.ptp(position[part]) <= play or not np.isfinite(shown[part]).all():
            continue
        half = window // 2
        halves = [np.mean(shown[part][:half]), np.mean(shown[part][half:])]
        # what drifts within a window is doubt, and no noise to be averaged
        noise = DEVIATIONS * float(np.std(shown[part])) / math.sqrt(window)
        doubt = noise + abs(float(halves[1] - halves[0])) + 0.5 * quantum
        doubt += float(np.ptp([np.mean(motor[part][:half]), np.mean(motor[part][half:])]))
        yield float(np.mean(shown[part])), doubt, float(np.mean(motor[part]))


def sensor_balance(rests: Rests, friction: float) -> SensorBalance | None:
    """Return what the rests allow; None without one, or where nothing explains all of them.

    Parameters
    ----------
    rests : Rests
        Where the device stood still.
    friction : float
        Greatest friction at rest, c [N m or N].
    """
    if len(rests.shown) == 0:
        return None
    apart = rests.motor[:, None] - rests.motor[None, :] - 2.0 * friction
    more = rests.shown[None, :] - rests.shown[:, None] + rests.doubt[:, None] + rests.doubt[None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        bounds = more / apart
    upper = float(np.min(bounds[apart > 0.0], initial=math.inf))
    lower = float(np.max(bounds[apart < 0.0], initial=0.0))
    if lower > upper:
        return None
    at = min(max(1.0, lower), upper)
    low = float(np.max(rests.shown - rests.doubt + at * (rests.motor - friction)))
    high = float(np.min(rests.shown + rests.doubt + at * (rests.motor + friction)))
    return SensorBalance(Interval(low, high), Interval(lower, upper), at, len(rests.shown))
