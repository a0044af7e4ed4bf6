"""One transaction at a time with one servo, before and after the loop; and who is on the line."""

from __future__ import annotations

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers import protocol1
from tautwave_drivers.echo import Unechoed
from tautwave_drivers.feetech.tables import Register
from tautwave_drivers.patience import SPARE, Patience, let_pass
from tautwave_drivers.protocol1 import BROADCAST, Status

RESPONSE_S = 0.02
"""Beyond wire time and latency: the longest return delay is 0.5 ms, the rest is the host."""
TRIES = 3
LISTEN_NS = 100_000_000
"""A master that moves servos speaks ten times a second at least."""
PING_NS = 150_000_000
"""Silence after which no further servo answers a broadcast ping."""
PROBE = protocol1.read_packet(BROADCAST, 5, 1)
"""A read that no servo answers, since it is addressed to all."""

BITS_PER_BYTE = 10


class ServoLine:
    """Transactions over a port.

    Parameters
    ----------
    port : Unechoed
        The line.
    clock : Clock
        What waits.
    baud : int
        For the wire time.
    latency_s : float
        Of the adapter [s].
    timeout_s : float
        Beyond wire time and latency.

    Attributes
    ----------
    garbled : bool
        Bytes came in the last transaction, but no answer.
    """

    def __init__(
        self,
        port: Unechoed,
        clock: Clock,
        baud: int,
        latency_s: float,
        timeout_s: float = RESPONSE_S,
    ) -> None:
        self._port = port
        self._clock = clock
        self._byte_ns = round(BITS_PER_BYTE * 1e9 / baud)
        self._timeout_ns = round(1e9 * (latency_s + timeout_s))
        self._patience = Patience()
        self.garbled = False

    def find_echo(self) -> None:
        """See whether the adapter returns what it sends."""
        wait_ns = len(PROBE) * self._byte_ns + self._timeout_ns
        self._port.find_echo(self._clock, PROBE, wait_ns)

    def read(self, device_id: int, register: Register, tries: int = TRIES) -> Status | None:
        """Return the bytes of a register, or of a block."""
        request = protocol1.read_packet(device_id, register.address, register.size)
        return self._transact(device_id, request, register.size, tries)

    def write(self, device_id: int, register: Register, value: int) -> Status | None:
        """Write a register; None: no answer, as of one that answers reads only."""
        request = protocol1.write_packet(device_id, register.address, register.encode(value))
        return self._transact(device_id, request, 0, 1)

    def tell(self, packet: bytes) -> None:
        """Send a packet to which there is no answer."""
        self._port.read()
        self._port.write(packet)

    def answers(self, device_id: int, register: Register) -> list[bytes]:
        """Return what all that have this id say about a register, within the longest delay."""
        request = protocol1.read_packet(device_id, register.address, register.size)
        heard: list[bytes] = []
        self._port.read()
        self._port.write(request)
        buffer = bytearray()
        until = self._until(request, 2 * register.size + protocol1.HEAD + 1)
        self.garbled = False
        while self._clock.wait(self._port, until):
            chunk = self._port.read()
            self.garbled |= bool(chunk)
            buffer += chunk
            while (one := protocol1.take_packet(buffer)) is not None:
                if one.device_id == device_id and len(one.data) == register.size:
                    heard.append(one.data)
        return heard

    def ping_all(self) -> list[int]:
        """Return the ids that answer a broadcast ping, as often as they do."""
        ids = []
        self._port.read()
        self._port.write(protocol1.build(BROADCAST, protocol1.PING))
        until = self._clock.now_ns() + PING_NS
        buffer = bytearray()
        self.garbled = False
        while self._clock.wait(self._port, until):
            chunk = self._port.read()
            self.garbled |= bool(chunk)
            buffer += chunk
            while (one := protocol1.take_packet(buffer)) is not None:
                ids.append(one.device_id)
                until = self._clock.now_ns() + PING_NS
        return ids

    def _until(self, request: bytes, size: int) -> int:
        wire_ns = (len(request) + protocol1.HEAD + 1 + size) * self._byte_ns
        return self._clock.now_ns() + wire_ns + self._timeout_ns

    def _transact(self, device_id: int, request: bytes, size: int, tries: int) -> Status | None:
        spare = SPARE
        first_ns = self._clock.now_ns()
        while tries:
            self._port.read()
            sent_ns = self._clock.now_ns()
            self._port.write(request)
            until = self._until(request, size) + self._patience.more_ns
            response = self._await(device_id, until, size)
            if response is not None:
                if sent_ns > first_ns:
                    span_ns = sent_ns - first_ns + self._timeout_ns // 2
                    let_pass(self._port, self._clock, span_ns)
                return response
            if self._patience.note(self._clock.now_ns() - until, self._timeout_ns) and spare:
                spare -= 1  # the host came late, not the servo
            else:
                tries -= 1
        return None

    def _await(self, device_id: int, until_ns: int, size: int) -> Status | None:
        """Return one servo's answer of this size; one of another length answers something else."""
        buffer = bytearray()
        self.garbled = False
        while True:
            chunk = self._port.read()
            self.garbled |= bool(chunk)
            buffer += chunk
            while (response := protocol1.take_packet(buffer)) is not None:
                if response.device_id == device_id and len(response.data) == size:
                    return response
            if not self._clock.wait(self._port, until_ns):
                return None


def refuse_another_master(port: Unechoed, clock: Clock, bus: str) -> None:
    """Listen before anything is sent: servos speak only when they are asked.

    Raises
    ------
    DriverError
        An instruction or an answer came.
    """
    port.read()  # bytes from before
    buffer = bytearray()
    until = clock.now_ns() + LISTEN_NS
    while clock.wait(port, until):
        buffer += port.read()
        # A broadcast is no answer: its id is beyond theirs. All of its bytes are looked at.
        at = buffer.find(protocol1.HEADER)
        while at >= 0:
            end = at + 4 + (buffer[at + 3] if len(buffer) > at + 3 else len(buffer))
            body = buffer[at + 2 : end - 1]
            if end <= len(buffer) and len(body) > 2 and protocol1.checksum(body) == buffer[end - 1]:
                raise DriverError(
                    f"bus {bus}: another master is at work on this line (to id {body[0]}), so a "
                    "servo may be moving; nothing was sent. Stop it, or give each master its own "
                    "line"
                )
            at = buffer.find(protocol1.HEADER, at + 1)
