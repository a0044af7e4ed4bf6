"""From the keys of a link to what either direction does to packets."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.config.keys.link import Link
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
