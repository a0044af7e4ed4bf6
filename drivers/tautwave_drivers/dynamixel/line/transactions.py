"""One transaction at a time with one servo, before and after the loop.

One small protocol, two implementations: `PacketLine` here and `sdk.SdkLine`. None is a
servo without a response; only a lost port raises.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

from tautwave.contracts import BytePort, Clock
from tautwave_drivers import protocol1
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol.packet import Packet
from tautwave_drivers.patience import SPARE, Patience, let_pass

RESPONSE_S = 0.03
"""Beyond wire time and the adapter's latency timer: the longest return delay is 0.5 ms, the rest
is the host."""

TRIES = 3
LONGEST_S = 0.017
"""The longest latency timer, for the one broadcast ping of protocol 2.0."""

TURN_S = 0.003
"""Time slot of every id after a broadcast ping, as dynamixel-sdk counts it."""


class Response(NamedTuple):
    """A servo's response: the error byte, and data as read."""

    error: int
    data: bytes

    @property
    def number(self) -> int:
        """The error without the alert bit; 0 when the instruction was carried out."""
        return self.error & ~packet.ALERT


class Line(Protocol):
    """Transactions with single servos; None where no response came."""

    def ping(self, device_id: int) -> Response | None:
        """Return model number (2 bytes) and firmware (1 byte)."""

    def read(self, device_id: int, address: int, size: int) -> Response | None:
        """Return `size` bytes at `address`."""

    def write(self, device_id: int, address: int, data: bytes) -> Response | None:
        """Write `data` at `address`."""

    def reboot(self, device_id: int) -> Response | None:
        """Restart the servo, which clears a hardware error."""


class PacketLine:
    """Our own packets over a `BytePort`.

    Parameters
    ----------
    port : BytePort
        The line.
    clock : Clock
        What waits.
    baud : int
        For the wire time.
    latency_s : float
        Latency timer of the adapter [s].
    timeout_s : float
        Beyond wire time and latency timer.
    """

    def __init__(
        self,
        port: BytePort,
        clock: Clock,
        baud: int,
        latency_s: float = 0.0,
        timeout_s: float = RESPONSE_S,
    ) -> None:
        self._port = port
        self._clock = clock
        self._byte_ns = round(1e10 / baud)
        self._timeout_ns = round(1e9 * (latency_s + timeout_s))
        self._patience = Patience()

    def ping(self, device_id: int) -> Response | None:
        """Return model number and firmware."""
        return self._transact(device_id, packet.build(device_id, packet.PING), 3)

    def read(
        self, device_id: int, address: int, size: int, limit_ns: int | None = None
    ) -> Response | None:
        """Return `size` bytes at `address`; tried only once with `limit_ns`, a deadline."""
        return self._transact(
            device_id, packet.read_packet(device_id, address, size), size, limit_ns
        )

    def write(self, device_id: int, address: int, data: bytes) -> Response | None:
        """Write `data` at `address`."""
        return self._transact(device_id, packet.write_packet(device_id, address, data), 0)

    def reboot(self, device_id: int) -> Response | None:
        """Restart the servo."""
        return self._transact(device_id, packet.build(device_id, packet.REBOOT), 0)

    def read_ns(self, size: int) -> int:
        """Return the wire time of a read of `size` bytes, both ways, return delay not counted."""
        return (14 + 11 + size) * self._byte_ns

    def _transact(
        self, device_id: int, request: bytes, size: int, limit_ns: int | None = None
    ) -> Response | None:
        tries, spare = (1, 0) if limit_ns is not None else (TRIES, SPARE)
        first_ns = self._clock.now_ns()
        while tries:
            self._port.read()
            sent_ns = self._clock.now_ns()
            self._port.write(request)
            wire_ns = (len(request) + 11 + size) * self._byte_ns
            wait_ns = wire_ns + self._timeout_ns + self._patience.more_ns
            until = limit_ns or self._clock.now_ns() + wait_ns
            response = _await(self._port, self._clock, device_id, until, packet.take_packet, size)
            if response is not None:
                if sent_ns > first_ns:
                    span_ns = sent_ns - first_ns + self._timeout_ns // 2
                    let_pass(self._port, self._clock, span_ns)
                return Response(response.error, response.data)
            late = self._patience.note(self._clock.now_ns() - until, self._timeout_ns)
            if late and spare:
                spare -= 1
            else:
                tries -= 1
        return None


def ping_all(port: BytePort, clock: Clock, baud: int) -> list[tuple[int, Response]]:
    """Return id and response of all servos that answer a broadcast ping, as often as they do."""
    responses = []
    port.read()
    port.write(packet.build(packet.BROADCAST, packet.PING))
    window_ns = round(1e9 * (253 * TURN_S + LONGEST_S + 24 * 10.0 / baud))
    until = clock.now_ns() + window_ns
    buffer = bytearray()
    while clock.wait(port, until):
        buffer += port.read()
        while (one := packet.take_packet(buffer)) is not None:
            if one.instruction == packet.STATUS and len(one.data) >= 3:
                responses.append((one.device_id, Response(one.error, one.data)))
                until = clock.now_ns() + window_ns
    return responses


class Protocol1Line:
    """Protocol 1.0 over a `BytePort`, reading only: for `scan`."""

    def __init__(
        self, port: BytePort, clock: Clock, baud: int, latency_s: float, timeout_s: float
    ) -> None:
        self._port = port
        self._clock = clock
        self._byte_ns = round(1e10 / baud)
        self._timeout_ns = round(1e9 * (latency_s + timeout_s))

    def ping(self, device_id: int) -> Response | None:
        """Return whether it is there: an error byte, no data."""
        return self._transact(device_id, protocol1.build(device_id, protocol1.PING), 0)

    def read(self, device_id: int, address: int, size: int) -> Response | None:
        """Return `size` bytes at `address`."""
        return self._transact(device_id, protocol1.read_packet(device_id, address, size), size)

    def _transact(self, device_id: int, request: bytes, size: int) -> Response | None:
        self._port.read()
        self._port.write(request)
        wire_ns = (len(request) + 6 + size) * self._byte_ns
        until = self._clock.now_ns() + wire_ns + self._timeout_ns
        response = _await(self._port, self._clock, device_id, until, _take_first, size)
        if response is None or len(response.data) < size:
            return None
        return Response(response.error, response.data)


def _take_first(buffer: bytearray) -> Packet | None:
    """Take a packet of protocol 1.0, as one of protocol 2.0."""
    status = protocol1.take_packet(buffer)
    if status is None:
        return None
    return Packet(status.device_id, packet.STATUS, bytes((status.error,)) + status.data)


def _await(
    port: BytePort,
    clock: Clock,
    device_id: int,
    until_ns: int,
    take: Callable[[bytearray], Packet | None],
    size: int,
) -> Packet | None:
    """Return one servo's response of `size` bytes, or its error; None if none came by `until_ns`.

    One of another length belongs to an earlier request and came late.
    """
    buffer = bytearray()
    while True:
        buffer += port.read()
        while (response := take(buffer)) is not None:
            if response.device_id != device_id or response.instruction != packet.STATUS:
                continue
            refused = not response.data and response.error & ~packet.ALERT
            if response.params and (len(response.data) == size or refused):
                return response
        if not clock.wait(port, until_ns):
            return None
