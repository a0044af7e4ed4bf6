"""One of two loops that send each other a sealed packet and a bare datagram in every slot.

`python -m tautwave.bench.sites.ends < ORDER.json` prints what it measured as one JSON object. Both
datagrams are as large as a wave pair's, are sent and asked for in the same cycles, in turn first;
a way counts for the kind that is asked for first, until it can be used: opened and read, or taken.

How long a datagram waits until the other loop looks depends on how the two loops stand to each
other. One has slots longer by `SWEEP`, so that they stand in every way in turn.
"""

from __future__ import annotations

import json
import sys
import time
from contextlib import suppress
from typing import Any

from tautwave.bench.live.loop import resident_bytes
from tautwave.bench.sites.order import HOST, HOSTILE, NETWORK, QUIET, Order, turn_of
from tautwave.clock import MonotonicClock
from tautwave.link.packet import Line, Packet, read_packet, write_packet
from tautwave.runtime.machine import quiet_collector, realtime
from tautwave.runtime.timing import Histogram
from tautwave.sites.control import Session
from tautwave.sites.datagrams import DataPort, open_socket

PAIRS = tuple((k, k) for k in range(4))
LINES = (Line(1, 2, PAIRS),)
SWEEP = 1e-3


class End:
    """Sockets and counts of an end."""

    def __init__(self, order: Order) -> None:
        names = ("master", "slave")
        session = Session(
            bytes.fromhex(order.session), bytes.fromhex(order.secret), names[1 - order.side], {}
        )
        self._side = order.side
        self._sent = 0
        self._to = (HOST, order.other[1])
        self._bare = open_socket(HOST, order.own[1])
        peer = (HOST, order.other[0])
        self._sealed = open_socket(HOST, order.own[0])
        self._port = DataPort(self._sealed, session, names[order.side], peer)
        self.sealed, self.bare, self.unread = Histogram(), Histogram(), Histogram()
        self.sealing, self.sending = Histogram(), Histogram()

    def exchange(self, slot: int, *, counts: bool) -> None:
        """Take what came, and send, either kind first in turn."""
        if slot & 1:
            self.take_sealed(self.sealed if counts else self.unread)
            self.take_bare(self.unread)
            self.send_bare(slot)
            self.send_sealed(slot)
        else:
            self.take_bare(self.bare if counts else self.unread)
            self.take_sealed(self.unread)
            self.send_sealed(slot)
            self.send_bare(slot)

    def counts(self) -> dict[str, int]:
        """Return how many packets were sent, how many datagrams accepted and refused."""
        opener = self._port.opener
        refused = sum(opener.refused.values())
        return {"sent": self._sent, "accepted": opener.accepted, "refused": refused}

    def drain(self) -> None:
        """Throw away what has waited while there was no network."""
        for sock in (self._sealed, self._bare):
            with suppress(BlockingIOError):
                while True:
                    sock.recv(2048)

    def take_sealed(self, times: Histogram) -> None:
        """Open and read packets; count how long they were under way."""
        for payload, _ in self._port.receive(32):
            packet = read_packet(payload, self._side)
            if isinstance(packet, Packet):
                times.add(time.monotonic_ns() - packet.clock_ns)

    def take_bare(self, times: Histogram) -> None:
        """Take bare datagrams; count how long they were under way."""
        for _ in range(32):
            try:
                datagram = self._bare.recv(2048)
            except BlockingIOError:
                return
            except OSError:
                continue
            times.add(time.monotonic_ns() - int.from_bytes(datagram[:8], "big"))

    def send_sealed(self, slot: int) -> None:
        """Write, seal and send a packet."""
        now = time.monotonic_ns()
        self._port.send(write_packet(Packet(self._side, slot + 4, now, 0, 0, LINES)))
        self.sealing.add(time.monotonic_ns() - now)
        self._sent += 1

    def send_bare(self, slot: int) -> None:
        """Send as many bytes, as they are."""
        now = time.monotonic_ns()
        try:
            self._bare.sendto(now.to_bytes(8, "big") + bytes(137), self._to)
        except OSError:
            return  # the other end is not there yet, or any more
        self.sending.add(time.monotonic_ns() - now)


def measure(order: Order) -> dict[str, Any]:
    """Run an end, with and without network in turn, and return its figures [us]."""
    end = End(order)
    clock = MonotonicClock()
    period = round((1.0 + SWEEP * order.side) * 1e9 / order.rate_hz)
    late = {turn: Histogram() for turn in (QUIET, NETWORK, HOSTILE)}
    memory = []
    with realtime(50, None, lock_memory=True) as sentences, quiet_collector():
        deadline = clock.now_ns()
        before = QUIET
        for slot in range(round(order.duration_s * order.rate_hz)):
            now = clock.now_ns()
            turn = turn_of(deadline)
            late[turn].add(now - deadline)
            if turn != QUIET and before == QUIET:
                end.drain()
            if turn != QUIET:
                end.exchange(slot, counts=turn == NETWORK)
            before = turn
            if slot % round(5.0 * order.rate_hz) == 0:
                memory.append(resident_bytes())
            deadline = max(deadline + period, now)
            clock.sleep_until(deadline)
    return {
        "sealed": end.sealed.summary(), "bare": end.bare.summary(),
        "sealing": end.sealing.summary(), "sending": end.sending.summary(),
        "late_with": late[NETWORK].summary(), "late_without": late[QUIET].summary(),
        "late_hostile": late[HOSTILE].summary(), **end.counts(),
        "memory": [*memory, resident_bytes()], "realtime": list(sentences),
    }  # fmt: skip


def main() -> int:
    """Run the end that stdin orders, and print what it measured."""
    json.dump(measure(Order(**json.load(sys.stdin))), sys.stdout)
    return 0


if __name__ == "__main__":
    sys.exit(main())
