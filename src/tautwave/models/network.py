"""A network between two sites: delay, jitter, loss in bursts, duplicates, order, outages; seeded.

Times are whole nanoseconds, so that every engine draws the same packet at the same moment. The
random numbers are those of two multiplicative generators combined, whose products fit 64 bits.

Sources: L'Ecuyer, Comm. ACM 31(6), 1988 (the generator); Gilbert, Bell Syst. Tech. J. 39(5), 1960
(loss in bursts: lossless or lossy, the lossy state left with a fixed chance).
"""

from __future__ import annotations

import math
from typing import NamedTuple

UNIFORM = 0
EXPONENTIAL = 1
SPIKES = 2
"""Kinds of jitter: evenly up to it; on average it; either it or nothing."""

LOST = -1
"""Arrival of a packet that does not arrive."""

MODULUS_ONE, FACTOR_ONE = 2147483563, 40014
MODULUS_TWO, FACTOR_TWO = 2147483399, 40692


class NetworkParams(NamedTuple):
    """What one direction does to packets.

    delay_ns: least delay; jitter: kind; jitter_ns: its size; spike_share: of packets, for SPIKES;
    begin, end: chances per packet that a burst of losses begins and ends; duplicates: share of
    packets that come twice; reorders: whether one may overtake another; outage_at_ns, outage_ns,
    outage_every_ns: first one, its length, and period [0: one only]. A recorded network takes the
    place of all that: `traced` pairs of time and delay in a table from `trace` on (`link.trace`).
    """

    delay_ns: int
    jitter: int
    jitter_ns: int
    spike_share: float
    begin: float
    end: float
    duplicates: float
    reorders: bool
    outage_at_ns: int
    outage_ns: int
    outage_every_ns: int
    trace: int = 0
    traced: int = 0


def network_params(
    delay: float,
    *,
    jitter: float = 0.0,
    kind: int = UNIFORM,
    spike_share: float = 0.02,
    loss: float = 0.0,
    burst: float = 1.0,
    duplicates: float = 0.0,
    reorders: bool = True,
    outage_at: float = 0.0,
    outage: float = 0.0,
    outage_every: float = 0.0,
) -> NetworkParams:
    """Return the constants of one direction.

    Parameters
    ----------
    delay, jitter : float
        Least delay and size of what comes on top [s].
    kind : int
        UNIFORM, EXPONENTIAL or SPIKES.
    spike_share, loss, duplicates : float
        Shares of packets [1]; loss below 1 / (1 + 1 / burst).
    burst : float
        Mean number of packets lost in a row, at least 1.
    reorders : bool
        Whether a packet may overtake another.
    outage_at, outage, outage_every : float
        Start of the first outage, length, from one to the next (0: one only) [s].
    """
    return NetworkParams(
        round(delay * 1e9),
        kind,
        round(jitter * 1e9),
        spike_share,
        loss / (burst * (1.0 - loss)),
        1.0 / burst,
        duplicates,
        reorders,
        round(outage_at * 1e9),
        round(outage * 1e9),
        round(outage_every * 1e9),
    )


def draw(one: int, two: int) -> tuple[int, int, float]:
    """Return the next state of the generator and a number in (0, 1)."""
    one = one * FACTOR_ONE % MODULUS_ONE
    two = two * FACTOR_TWO % MODULUS_TWO
    mixed = one - two
    if mixed < 1:
        mixed += MODULUS_ONE - 1
    return one, two, mixed / MODULUS_ONE


def seeded(seed: int, direction: int) -> tuple[int, int]:
    """Return a state of the generator; seeds and directions next to each other are unlike."""
    one = 1 + (seed * 69069 + 12345 * direction + 1) % (MODULUS_ONE - 1)
    two = 1 + (seed * 1664525 + 1013904223 * (direction + 1)) % (MODULUS_TWO - 1)
    for _ in range(4):
        one, two, _ = draw(one, two)
    return one, two


def is_down(p: NetworkParams, now_ns: int) -> bool:
    """Return whether an outage lasts at a moment [ns]."""
    since = now_ns - p.outage_at_ns
    if since < 0:
        return False
    if p.outage_every_ns > 0:
        since = since % p.outage_every_ns
    return since < p.outage_ns


def late_ns(p: NetworkParams, chance: float) -> int:
    """Return what jitter adds to the delay [ns], of a number in (0, 1)."""
    if p.jitter == UNIFORM:
        return int(p.jitter_ns * chance)
    if p.jitter == EXPONENTIAL:
        return int(-p.jitter_ns * math.log(chance))
    if chance < p.spike_share:
        return p.jitter_ns
    return 0


def transit(
    p: NetworkParams, one: int, two: int, losing: bool, last_ns: int, now_ns: int
) -> tuple[int, int, bool, int, int, int]:
    """Send one packet.

    Parameters
    ----------
    p : NetworkParams
        Constants.
    one, two : int
        State of the generator.
    losing : bool
        Whether a burst of losses lasts.
    last_ns : int
        Latest arrival so far [ns].
    now_ns : int
        When the packet leaves [ns].

    Returns
    -------
    tuple
        The new generator, burst and latest arrival; arrival of the packet, and of its duplicate
        [ns], LOST for none. Each packet draws the same four numbers, whatever becomes of it.
    """
    one, two, turn = draw(one, two)
    one, two, chance = draw(one, two)
    one, two, again = draw(one, two)
    one, two, second = draw(one, two)
    if losing:
        losing = turn >= p.end
    else:
        losing = turn < p.begin
    if losing or is_down(p, now_ns):
        return one, two, losing, last_ns, LOST, LOST
    arrival = now_ns + p.delay_ns + late_ns(p, chance)
    if not p.reorders and arrival < last_ns:
        arrival = last_ns
    if arrival > last_ns:
        last_ns = arrival
    copy = LOST
    if again < p.duplicates:
        copy = now_ns + p.delay_ns + late_ns(p, second)
        if copy < arrival:
            copy = arrival
    return one, two, losing, last_ns, arrival, copy
