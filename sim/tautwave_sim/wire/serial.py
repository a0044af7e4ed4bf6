"""A half-duplex serial line, bytes at their baud rate, with the adapter at the host's end.

Ten bits a byte (8N1) by default. The line knows no protocols: what is on it is a `Listener`, which
is called when the first byte from the host leaves, and responds through `SerialLine.respond`. Two
that send at once garble both; one that only waits to respond gives up.
"""

from __future__ import annotations

from typing import Protocol

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_sim.wire.schedule import Schedule

BITS_PER_BYTE = 10
USB_PACKET = 62
"""Bytes of serial data in a full-speed USB packet of an FTDI chip (64 less two of status)."""

GARBLE = 0x5A


def wire_ns(count: int, baud: int, bits: int = BITS_PER_BYTE) -> int:
    """Return how long `count` bytes of `bits` bits are on the wire [ns], rounded up."""
    return -(-count * bits * 1_000_000_000 // baud)


class Transmission:
    """Bytes on the wire: `data` from `start_ns` to `end_ns` at `baud`."""

    __slots__ = ("_clean", "baud", "bits", "cancelled", "data", "end_ns", "late_ns", "start_ns")

    def __init__(
        self, data: bytes, start_ns: int, baud: int, late_ns: int = 0, bits: int = BITS_PER_BYTE
    ) -> None:
        self.data = bytearray(data)
        self.start_ns = start_ns
        self.end_ns = start_ns + wire_ns(len(data), baud, bits)
        self.baud = baud
        self.bits = bits
        self.late_ns = late_ns
        self.cancelled = False
        self._clean = len(data)

    @property
    def garbled(self) -> bool:
        """Whether another spoke at the same time."""
        return self._clean < len(self.data)

    def end_of_byte_ns(self, index: int) -> int:
        """Return when byte `index` has arrived [ns]."""
        return self.start_ns + wire_ns(index + 1, self.baud, self.bits)

    def garble_from(self, time_ns: int) -> None:
        """Spoil every byte that is on the wire at `time_ns` or later."""
        first = max((time_ns - self.start_ns) * self.baud // (self.bits * 10**9), 0)
        for index in range(first, self._clean):
            self.data[index] ^= GARBLE
        self._clean = min(self._clean, first)


class Listener(Protocol):
    """All devices on the line together."""

    def hear(self, sent: Transmission) -> None:
        """Note what the host sends; called when its first byte leaves."""
        ...


class SerialLine(Schedule):
    """The line and its adapter, run by events.

    Parameters
    ----------
    baud : int
        The host's baud rate; may be set at any time.
    latency_ns : int
        Latency timer of the adapter [ns]: what has arrived is handed over at its ticks, or when 62
        bytes have come. 0: each transmission is handed over when its last byte has arrived.
    bits : int
        Bits of a byte on the wire: start, data, parity and stop; 11 for 8E1 or 8N2.
    echoes : bool
        The adapter hears what it sends itself, and hands it to the host.
    """

    def __init__(
        self,
        baud: int,
        latency_ns: int = 0,
        bits: int = BITS_PER_BYTE,
        echoes: bool = False,
    ) -> None:
        super().__init__()
        self._echoes = echoes
        self.baud = baud
        self.bits = bits
        self.latency_ns = latency_ns
        self.listener: Listener | None = None
        self.plugged = True
        self._inbox = bytearray()
        self._held = bytearray()
        self._tick_base_ns = 0
        self._tick_due = False
        self._last_arrival_ns = 0
        self._host: Transmission | None = None
        self._responses: list[Transmission] = []

    # ------------------------------------------------------------------------- the host's end

    def host_write(self, data: bytes, now_ns: int) -> None:
        """Send bytes from the host; they queue behind those it is still sending."""
        self.advance(now_ns)
        if not data or not self.plugged:
            return
        start_ns = now_ns
        if self._host is not None:
            start_ns = max(start_ns, self._host.end_ns)
        sent = Transmission(data, start_ns, self.baud, bits=self.bits)
        for response in self._responses:
            if response.start_ns >= start_ns:
                response.cancelled = True
            elif response.end_ns > start_ns:
                response.garble_from(start_ns)
                sent.garble_from(start_ns)
        self._responses = [
            one for one in self._responses if one.end_ns > now_ns and not one.cancelled
        ]
        self._host = sent
        if self._echoes:
            self._at_arrival(sent, 0, len(data), sent.end_ns)
        if self.listener is not None:
            self.listener.hear(sent)

    def readable(self) -> bool:
        """Return whether the adapter has handed bytes over."""
        return bool(self._inbox)

    def take(self) -> bytes:
        """Return all that the adapter has handed over, and forget it."""
        taken = bytes(self._inbox)
        self._inbox.clear()
        return taken

    def unplug(self) -> None:
        """Lose the adapter with all that is in it and on the wire."""
        self.plugged = False
        for response in self._responses:
            response.cancelled = True
        self._responses.clear()
        self._host = None
        self._inbox.clear()
        self._held.clear()

    # ---------------------------------------------------------------------- the devices' end

    def respond(self, data: bytes, at_ns: int, baud: int, late_ns: int = 0) -> Transmission:
        """Send bytes from a device at `at_ns`; `late_ns` is lost behind the wire, in the adapter.

        The one transmission returned may still be `cancelled` before it begins.
        """
        sent = Transmission(data, at_ns, baud, late_ns, self.bits)
        others = self._responses if self._host is None else [self._host, *self._responses]
        for other in others:
            if other.start_ns < sent.end_ns and other.end_ns > at_ns and not other.cancelled:
                both_ns = max(other.start_ns, at_ns)
                other.garble_from(both_ns)
                sent.garble_from(both_ns)
        self._responses.append(sent)
        self.call_at(at_ns, lambda: self._begin(sent))
        return sent

    def _begin(self, sent: Transmission) -> None:
        if sent.cancelled:
            return
        if sent.baud != self.baud:
            return  # framing errors at the host: nothing usable
        done = 0
        if self.latency_ns:  # what has come when the timer ticks is handed over then
            tick_ns = self._next_tick_ns(sent.start_ns)
            while tick_ns < sent.end_ns:
                whole = self._arrived(sent, tick_ns)
                if whole > done:
                    self._at_arrival(sent, done, whole, tick_ns)
                    done = whole
                tick_ns += self.latency_ns
        self._at_arrival(sent, done, len(sent.data), sent.end_ns)

    def _arrived(self, sent: Transmission, time_ns: int) -> int:
        count = (time_ns - sent.start_ns) * sent.baud // (sent.bits * 1_000_000_000)
        return min(int(count), len(sent.data))

    def _at_arrival(self, sent: Transmission, first: int, last: int, time_ns: int) -> None:
        # A stream keeps its order: what follows a late piece is late with it.
        due_ns = max(time_ns + sent.late_ns, self._last_arrival_ns)
        self._last_arrival_ns = due_ns
        self.call_at(due_ns, lambda: self._arrive(sent, first, last, due_ns))

    def _arrive(self, sent: Transmission, first: int, last: int, time_ns: int) -> None:
        if sent.cancelled or not self.plugged:
            return
        if not self.latency_ns:
            self._inbox += sent.data[first:last]
            return
        self._held += sent.data[first:last]
        while len(self._held) >= USB_PACKET:
            self._inbox += self._held[:USB_PACKET]
            del self._held[:USB_PACKET]
            self._tick_base_ns = time_ns
        if self._held and not self._tick_due:
            self._tick_due = True
            tick_ns = self._next_tick_ns(time_ns)
            self.call_at(tick_ns, lambda: self._tick(tick_ns))

    def _next_tick_ns(self, time_ns: int) -> int:
        ticks = -(-(time_ns - self._tick_base_ns) // self.latency_ns)
        return self._tick_base_ns + max(ticks, 1) * self.latency_ns

    def _tick(self, time_ns: int) -> None:
        self._tick_due = False
        self._tick_base_ns = time_ns
        self._inbox += self._held
        self._held.clear()


class MemoryPort:
    """The host's end in this process: a `BytePort` that a clock runs while it waits."""

    def __init__(self, line: SerialLine, clock: Clock, name: str) -> None:
        self._line = line
        self._clock = clock
        self._name = name

    @property
    def baud(self) -> int:
        """Baud rate of this end; may be set."""
        return self._line.baud

    @baud.setter
    def baud(self, baud: int) -> None:
        self._line.baud = baud

    def write(self, data: bytes) -> None:
        """Hand bytes to the line; raises `DriverError` when it is unplugged."""
        self._line.advance(self._clock.now_ns())
        self._check()
        self._line.host_write(bytes(data), self._clock.now_ns())

    def read(self) -> bytes:
        """Return all that has come; raises `DriverError` when the line is unplugged."""
        self._line.advance(self._clock.now_ns())
        self._check()
        return self._line.take()

    def close(self) -> None:
        """Forget what was not read; the line stays, and can be used again."""
        self._line.take()

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself [ns]."""
        return self._line.next_event_ns()

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        self._line.advance(to_ns)

    def readable(self) -> bool:
        """Return whether there is something to read, or the line is gone."""
        return self._line.readable() or not self._line.plugged

    def _check(self) -> None:
        if not self._line.plugged:
            raise DriverError(f"{self._name}: the adapter was unplugged; plug it in and run again")
