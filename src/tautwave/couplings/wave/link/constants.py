"""From the keys of a link to the constants of its receivers, and its part of the table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.config.keys.common import AUTO
from tautwave.config.keys.link import Link
from tautwave.couplings.over_link.constants import FEWEST_DAYS, reach, way_of
from tautwave.couplings.wave.keys import WavePair
from tautwave.couplings.wave.link.law import LinkEndParams, LinkParams
from tautwave.laws.counters import WAVE_QUANTUM
from tautwave.laws.receiver import ReceiverParams, receiver_params
from tautwave.link.network import network_places
from tautwave.link.receiver import EMPTY, PLACE, ring_size

CATCH_UP = 0.25
"""Share of the lower velocity limit at which a backlog is repaid at most."""


class Linked(NamedTuple):
    """A pair's link as constants, and the part of the table that it begins with."""

    params: LinkParams
    table: list[float]


def receiver_of(link: Link, pair: WavePair, period: float, velocity: float) -> ReceiverParams:
    """Return the constants of both receivers; `velocity`: lower limit [rad/s or m/s, master]."""
    depth = 0.0 if link.depth_s == AUTO else float(link.depth_s)
    return receiver_params(
        period,
        sender_period=period,
        depth=depth,
        deepest=link.deepest_s if link.depth_s == AUTO else depth,
        newest=link.play_out == "newest",
        fastest=math.sqrt(2.0 * pair.impedance) * CATCH_UP * velocity,
    )


def linked(
    link: Link,
    pair: WavePair,
    period: float,
    velocity: float,
    seed: int,
    at: int,
    trace: Sequence[float] = (),
) -> Linked:
    """Return a pair's link.

    Parameters
    ----------
    link, pair : Link, WavePair
        Their keys, with numbers for `auto`.
    period : float
        Of a slot [s].
    velocity : float
        The lower velocity limit of both devices [rad/s or m/s, master].
    seed : int
        Of the rig, unless the link has its own.
    at : int
        Where its part of the table begins.
    trace : sequence of float
        The recorded network (`link.trace`), if there is one.
    """
    receiver = receiver_of(link, pair, period, velocity)
    places = max(ring_size(receiver), link.repeated + 2)
    days = max(FEWEST_DAYS, math.ceil(reach(link, trace) / period) + 2 * link.repeated + 4)
    table: list[float] = []
    ends = []
    for direction in (0, 1):
        ring = at + len(table)
        table += [EMPTY] * (PLACE * places)
        post = at + len(table)
        table += [EMPTY] * network_places(days)
        last = at + len(table)
        table += [EMPTY]
        own = at + len(table)
        table += [float(seed if link.seed is None else link.seed)]
        ends.append(
            LinkEndParams(
                receiver=receiver,
                network=way_of(link, 0, 0),
                seed=own,
                direction=direction,
                ring=ring,
                places=places,
                post=post,
                days=days,
                last=last,
                repeated=link.repeated,
                silence=round(link.silence_s / period),
                lost=round(link.lost_s / period),
                position=WAVE_QUANTUM / math.sqrt(2.0 * pair.impedance),
            )
        )
    if trace:
        way = way_of(link, at + len(table), len(trace) // 2)
        ends = [end._replace(network=way) for end in ends]
        table += trace
    params = LinkParams(round(period * 1e9), ends[0], ends[1])
    return Linked(params, table)
