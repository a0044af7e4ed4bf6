"""Quality of the path between two sites: both send at a rate and record what arrives.

The delay of one way rests on two clocks whose offset is known to half the round trips; what
varies in it, loss and order are known surely.
"""

from __future__ import annotations

import math
import select
import struct
import time
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.errors import LinkError
from tautwave.link.clocks import Exchange, clock_doubt, clock_line, exchange, keep_best
from tautwave.sites.datagrams import DataPort

PAYLOAD = struct.Struct(">QQQQ24x")
"""Number, sender's clock, echo of ours and how long it was held [ns]; padded to a wave's size."""

MAX_AT_ONCE = 256
MAX_WINDOWS = 3600
"""All of a test: a line through its end would err at its beginning."""
SILENCE_S = 3.0
TAIL_S = 0.5
"""For so long the last datagrams are waited for [s]."""


class Arrival(NamedTuple):
    """One datagram: its number, when it was sent by the other's clock and came by ours [ns]."""

    number: int
    sent_ns: int
    came_ns: int


class Heard(NamedTuple):
    """What one end heard of the other, and the best exchanges of the windows."""

    arrivals: tuple[Arrival, ...]
    best: tuple[Exchange, ...]
    sent: int


class Way(NamedTuple):
    """One direction of a path.

    sent, lost, reordered: datagrams; longest: most lost in a row; delays [s]: least, median, p99,
    p99.9, greatest; unknown [s]: by how much all delays may be off, half the round trips;
    rate [1]: by how much the sender's clock is faster, and by how much that may be off.
    """

    sent: int
    lost: int
    reordered: int
    longest: int
    least: float
    median: float
    p99: float
    p999: float
    greatest: float
    unknown: float
    rate: float
    rate_unknown: float

    @property
    def depth(self) -> float:
        """Return the play-out depth with which 99 % come in time [s]."""
        return self.p99 - self.least


def probe(port: DataPort, rate_hz: float, duration_s: float) -> Heard:
    """Send at a rate and listen; both ends do so at the same time.

    Raises
    ------
    LinkError
        Nothing came for `SILENCE_S`.
    """
    period_ns = round(1e9 / rate_hz)
    count = round(duration_s * rate_hz)
    arrivals: list[Arrival] = []
    best: tuple[Exchange, ...] = ()
    newest = (0, 0)
    sent = 0
    start = heard_ns = time.monotonic_ns()
    while True:
        now = time.monotonic_ns()
        if not port.has_peer:
            start = now  # the serving site begins with the first datagram
        elif sent < count and now >= start + sent * period_ns:
            clock, came = newest
            port.send(PAYLOAD.pack(sent, now, clock, now - came if clock else 0))
            sent += 1
        end = start + count * period_ns + round(TAIL_S * 1e9)
        due = start + sent * period_ns if 0 < sent < count else end
        select.select([port], [], [], max(0.0, min(0.1, 1e-9 * (due - time.monotonic_ns()))))
        for payload, came in port.receive(MAX_AT_ONCE):
            heard_ns = came
            if len(payload) != PAYLOAD.size:
                continue
            number, clock, echo, held = PAYLOAD.unpack(payload)
            arrivals.append(Arrival(number, clock, came))
            if clock > newest[0]:
                newest = (clock, came)
            if echo:
                best = keep_best(best, exchange(came, clock, echo, held), MAX_WINDOWS)
        if sent == count and now >= end:
            return Heard(tuple(arrivals), best, sent)
        if sent < count and now - heard_ns > SILENCE_S * 1e9:
            raise LinkError(
                f"no datagram from the other site arrived for {SILENCE_S:g} s; check the UDP port "
                "(firewall, forwarding)"
            )


def way_of(heard: Heard, sent: int) -> Way:
    """Return the quality of a direction from what its receiving end heard of `sent` datagrams.

    Raises
    ------
    LinkError
        Nothing came at all.
    """
    if not heard.arrivals or not heard.best:
        raise LinkError("no datagram from the other site arrived; check the UDP port")
    delays = delays_of(heard)
    ordered = sorted(delays)
    numbers = [one.number for one in heard.arrivals]
    known = sorted(set(numbers))
    gaps = [b - a - 1 for a, b in zip([-1, *known], [*known, sent], strict=True)]
    newest, late = -1, 0
    for number in numbers:
        late += number < newest
        newest = max(newest, number)
    _, rate = clock_line(heard.best, heard.best[0].at)
    trips = [one.round_trip for one in heard.best]
    span = heard.best[0].at - heard.best[-1].at
    rate_unknown = 0.5 * (max(trips) - min(trips)) / span if span > 0.0 else 1.0
    return Way(
        sent, sent - len(known), late, max(gaps),
        ordered[0], quantile(ordered, 0.5), quantile(ordered, 0.99), quantile(ordered, 0.999),
        ordered[-1], clock_doubt(heard.best), rate, rate_unknown,
    )  # fmt: skip


def delays_of(heard: Heard) -> list[float]:
    """Return the delay of each datagram that came [s], by the line through both clocks."""
    last = heard.arrivals[-1].came_ns * 1e-9
    offset, rate = clock_line(heard.best, last)
    return [
        (one.came_ns - one.sent_ns) * 1e-9 + offset + rate * (one.came_ns * 1e-9 - last)
        for one in heard.arrivals
    ]


def quantile(ordered: Sequence[float], share: float) -> float:
    """Return the smallest value that at least `share` of all do not exceed."""
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]
