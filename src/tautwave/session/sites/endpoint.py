"""One end of the data plane in the loop: a socket that is asked once a slot, clocks, counts."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence

from tautwave.errors import LinkError
from tautwave.link.clocks import (
    Exchange,
    clock_doubt,
    clock_line,
    exchange,
    keep_best,
    slot_stretch,
)
from tautwave.link.packet import Line, Packet, read_packet, write_packet
from tautwave.sites.control import Session
from tautwave.sites.datagrams import DataPort

MAX_AT_ONCE = 32
"""Datagrams looked at in a slot: a flood costs the loop no more than that."""
SETTLE_S = 10.0
"""Time in which the follower's slots make up for being late [s]."""
TURN_S = 1.0
"""Time between two looks at the clocks [s]."""
FIRST_S = 0.25
"""And from the beginning of a session to the first one [s]."""
HELLO = b"hello"
"""Shorter than any packet: it says where the dialling site is, and nothing else."""


Take = Callable[[int, Sequence[Line]], None]


class Endpoint:
    """Packets of one session after the other with the other site, all pairs in each.

    Parameters
    ----------
    sock : socket
        Of the data plane.
    side : int
        0 master, 1 slave.
    pairs : int
        Lines of a packet.
    now_ns : callable
        The loop's clock [ns].
    """

    def __init__(
        self, sock: socket.socket, side: int, pairs: int, now_ns: Callable[[], int]
    ) -> None:
        self._socket = sock
        self._now_ns = now_ns
        self._side = side
        self._pairs = pairs
        self._used: set[bytes] = set()
        self._me = ("master", "slave")[side]
        self._port: DataPort | None = None
        self._newest = -1
        self._echo_ns = self._came_ns = 0
        self._best: tuple[Exchange, ...] = ()
        self._looked_ns = 0
        self._line = (0.0, 0.0)
        self.heard_ns = 0
        self.delay = 0.0
        self.got = self.unread = 0
        self.refused: dict[str, int] = {}

    def join(self, session: Session, peer: tuple[str, int] | None) -> None:
        """Go over to a session; of the one before nothing is taken any more.

        Raises
        ------
        LinkError
            It was used before: its numbers would be, too.
        """
        if session.id in self._used:
            raise LinkError(f"session {session.id.hex()} was used before")
        self._used.add(session.id)
        self.count()
        self._port = DataPort(self._socket, session, self._me, peer, self._now_ns)
        self._newest = -1
        self._echo_ns = self._came_ns = 0
        self._best = ()
        self._line = (0.0, 0.0)
        self.heard_ns = self._now_ns()
        self._looked_ns = self.heard_ns - round((TURN_S - FIRST_S) * 1e9)

    def receive(self, take: Take | None) -> bool:
        """Hand over the lines of each packet that came; return whether any did."""
        if self._port is None:
            return False
        came = False
        for payload, now in self._port.receive(MAX_AT_ONCE):
            packet = read_packet(payload, self._side)
            if not isinstance(packet, Packet) or len(packet.lines) != self._pairs:
                self.unread += payload != HELLO
                continue
            if take is not None:
                came = True
                self.got += 1
                self.heard_ns = now
                take(packet.slot, packet.lines)
            if packet.slot > self._newest:
                self._newest = packet.slot
                self._echo_ns, self._came_ns = packet.clock_ns, now
                if packet.echo_ns:
                    timed = exchange(now, packet.clock_ns, packet.echo_ns, packet.held_ns)
                    if not self._best:
                        self._line = (timed.offset, 0.0)
                    self._best = keep_best(self._best, timed)
                if self._best:
                    self.delay = (now - packet.clock_ns) * 1e-9 + self.offset
        return came

    def greet(self) -> None:
        """Let the serving site know where this one is."""
        if self._port is not None:
            self._port.send(HELLO)

    def send(self, slot: int, lines: tuple[Line, ...]) -> None:
        """Send what a slot of all pairs says."""
        if self._port is None:
            return
        now = self._now_ns()
        held = now - self._came_ns if self._echo_ns else 0
        packet = Packet(self._side, slot, now, self._echo_ns, held, lines)
        self._port.send(write_packet(packet))

    def look_at_clocks(self, now_ns: int) -> bool:
        """Fit the line through both clocks if it is time; return whether it was."""
        if now_ns - self._looked_ns < TURN_S * 1e9 or not self._best:
            return False
        self._looked_ns = now_ns
        self._line = clock_line(self._best, now_ns * 1e-9)
        return True

    def ahead(self, slot: int, now_ns: int, period_ns: int) -> float:
        """Return by how many slots the own count, `slot` just now, is ahead of the other's."""
        sent = self._echo_ns - self.offset * 1e9  # by the own clock
        return slot - (now_ns - sent) / period_ns - self._newest

    def stretch(self, late: float) -> float:
        """Return by what share the follower's slots are longer, where they are `late` [s]."""
        return slot_stretch(self._line[1], late, SETTLE_S)

    @property
    def offset(self) -> float:
        """Return by how much the other's clock is ahead [s], to half a round trip."""
        return self._line[0]

    def clocks(self) -> dict[str, float] | None:
        """Return offset and rate of the other's clock when it was last heard, and the doubt [s]."""
        if not self._best:
            return None
        heard = self._best[0].at
        offset, rate = clock_line(self._best, heard)
        return {"offset_s": offset, "rate": rate, "unknown_s": clock_doubt(self._best)}

    def count(self) -> dict[str, int]:
        """Return how many datagrams were refused so far, by reason."""
        if self._port is not None:
            opener = self._port.opener
            for why, number in opener.refused.items():
                self.refused[why] = self.refused.get(why, 0) + number
                opener.refused[why] = 0
        return self.refused
