"""Offset and rate of the other site's clock, from packets that echo each other.

Of each window only the packet with the least round trip counts: what waited in a queue tells of
the queue. A line through the last windows gives offset and rate. An unlike delay of the two ways
enters by half and cannot be seen, so an offset is right to half the round trips at best, and
`clock_doubt` says to how much: it is for plots and for the slot grid, never for a decision on
safety.

The follower's slots are stretched by at most `MAX_SLEW`, never shifted in a step: T differs by
2e-4 at most, and each side's slots keep one numbering.

Source: Mills, RFC 5905 (clock filter and discipline of NTP).
"""

from __future__ import annotations

import math
from typing import NamedTuple

MAX_SLEW = 200e-6
"""Share by which a slot may be longer or shorter than T: ordinary crystals are within 100 ppm."""


WINDOW_S = 1.0
WINDOWS = 10
"""The best of each window [s] is kept, for so many windows."""


class Exchange(NamedTuple):
    """One exchange of time stamps, or the best of a window.

    at: own clock when it came [s]; offset: the other's clock less the own one [s]; round_trip [s].
    """

    at: float
    offset: float
    round_trip: float


def exchange(now_ns: int, clock_ns: int, echo_ns: int, held_ns: int) -> Exchange:
    """Return what a packet tells that came at `now_ns`; times [ns] as in `link.packet.Packet`."""
    round_trip_ns = now_ns - echo_ns - held_ns
    offset_ns = clock_ns - now_ns + round_trip_ns // 2
    return Exchange(now_ns * 1e-9, offset_ns * 1e-9, round_trip_ns * 1e-9)


def keep_best(
    best: tuple[Exchange, ...], new: Exchange, windows: int = WINDOWS
) -> tuple[Exchange, ...]:
    """Return the best exchange of this window and of those before, newest first."""
    if new.round_trip < 0.0:  # one of the clocks stood still meanwhile
        return best
    if not best or new.at // WINDOW_S > best[0].at // WINDOW_S:
        return (new, *best[:windows])
    if new.round_trip < best[0].round_trip:
        return (new, *best[1:])
    return best


def clock_line(best: tuple[Exchange, ...], now: float) -> tuple[float, float]:
    """Return offset [s] at `now` [s] and rate [1] of the other's clock, by least squares.

    The window that still lasts does not count, if there is another: its best may be poor.
    """
    best = best[1:] or best
    if not best:
        return 0.0, 0.0
    count = len(best)
    middle = sum(one.at for one in best) / count
    level = sum(one.offset for one in best) / count
    spread = sum((one.at - middle) ** 2 for one in best)
    if spread == 0.0:
        return level, 0.0
    rate = sum((one.at - middle) * (one.offset - level) for one in best) / spread
    return level + rate * (now - middle), rate


def clock_doubt(best: tuple[Exchange, ...]) -> float:
    """Return by how much the offset of `clock_line` may be off in the middle of its windows [s].

    There all exchanges weigh alike, and each may be off by half its round trip.
    """
    best = best[1:] or best
    if not best:
        return math.inf
    return 0.5 * sum(one.round_trip for one in best) / len(best)


def slot_stretch(rate: float, late: float, settle: float) -> float:
    """Return by what share the follower's next slots are longer [1].

    Parameters
    ----------
    rate : float
        By how much the leader's clock is faster [1].
    late : float
        How far the follower's slots are behind the leader's [s].
    settle : float
        Time constant in which that is made up [s].
    """
    stretch = -rate - late / settle
    return max(-MAX_SLEW, min(MAX_SLEW, stretch))
