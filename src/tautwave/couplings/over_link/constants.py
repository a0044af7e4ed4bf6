"""From the keys of a link to the constants of what is said over it, and its part of the table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tautwave.config.keys.link import Link
from tautwave.couplings.over_link.law import NewsEndParams, NewsParams
from tautwave.link.network import network_places
from tautwave.link.receiver import EMPTY
from tautwave.models import network

KINDS = {
    "uniform": network.UNIFORM,
    "exponential": network.EXPONENTIAL,
    "spikes": network.SPIKES,
}
LONGEST_JITTER = 20.0
"""Of an exponential jitter, in its means: later packets are lost, two in a billion."""
FEWEST_DAYS = 64


def way_of(link: Link, trace: int, traced: int) -> network.NetworkParams:
    """Return what either direction does; `traced` pairs lie in the table from `trace` on."""
    return network.network_params(
        link.delay_s,
        jitter=link.jitter_s,
        kind=KINDS[link.jitter],
        loss=link.loss,
        burst=link.burst,
        duplicates=link.duplicate,
        reorders=link.reorder,
        outage_at=link.outage_at_s,
        outage=link.outage_s,
        outage_every=link.outage_every_s,
    )._replace(trace=trace, traced=traced)


def reach(link: Link, trace: Sequence[float]) -> float:
    """Return after how long a packet counts as lost [s]."""
    if trace:
        return 1e-9 * max(trace[1::2])
    longest = LONGEST_JITTER if link.jitter == "exponential" else 1.0
    return link.delay_s + longest * link.jitter_s


def linked(
    link: Link,
    pair: Any,
    period: float,
    velocity: float,
    seed: int,
    at: int,
    trace: Sequence[float] = (),
) -> tuple[NewsParams, list[float]]:
    """Return a pair's link: as `couplings.wave.link.constants.linked`, without a receiver."""
    days = max(FEWEST_DAYS, math.ceil(reach(link, trace) / period) + 4)
    table: list[float] = []
    ends = []
    for direction in (0, 1):
        post = at + len(table)
        table += [EMPTY] * network_places(days)
        last = at + len(table)
        table += [EMPTY]
        own = at + len(table)
        table += [float(seed if link.seed is None else link.seed)]
        ends.append(
            NewsEndParams(
                network=way_of(link, 0, 0),
                seed=own,
                direction=direction,
                post=post,
                days=days,
                last=last,
                repeated=0,
                silence=round(link.silence_s / period),
                lost=round(link.lost_s / period),
                position=1.0 if direction else 1.0 / pair.position_scale,
            )
        )
    if trace:
        way = way_of(link, at + len(table), len(trace) // 2)
        ends = [end._replace(network=way) for end in ends]
        table += trace
    return NewsParams(round(period * 1e9), ends[0], ends[1]), table
