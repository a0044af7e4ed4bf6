"""One cycle on the line: one sync write of the goals, one sync read of all servos.

What dynamixel-sdk's group classes do not do: every servo's answer counts by itself, a missing one
costs no other; its error byte is kept; what is sent is stuffed; the host waits in the kernel.

Servos answer in the order asked, and some wait for the one before them. So who did not answer last
time is asked last: it can hold nobody up, and is waited for only as long as its answer takes on the
wire. Nothing read before a request is believed to belong to it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from tautwave.contracts import BytePort, Clock
from tautwave_drivers.dynamixel import packet
from tautwave_drivers.dynamixel.budget import BITS_PER_BYTE
from tautwave_drivers.dynamixel.fast import FastStatus
from tautwave_drivers.dynamixel.registers import Register

SLACK_NS = 100_000
"""Beyond its wire time, for a servo that was missing before: turn-around and host."""


class Goals:
    """The sync write of one register of some servos, with values that change.

    Parameters
    ----------
    register : Register
        What is written.
    ids : sequence of int
        Of whom.
    """

    def __init__(self, register: Register, ids: Sequence[int]) -> None:
        self._register = register
        self._values = [number for one in ids for number in (one, 0)]
        self._body = struct.Struct("<" + ("Bh" if register.size == 2 else "Bi") * len(ids))
        whole = packet.sync_write_packet(register.address, register.size, self._pairs())
        self._head = whole[: -2 - self._body.size]
        self._head_crc = packet.crc16(self._head)

    def put(self, index: int, counts: int) -> None:
        """Set the value of the `index`-th servo, for the packets to come."""
        self._values[2 * index + 1] = counts

    def packet(self) -> bytes:
        """Return the sync write."""
        body = self._body.pack(*self._values)
        if packet.PATTERN in body:
            pairs = self._pairs()
            return packet.sync_write_packet(self._register.address, self._register.size, pairs)
        crc = packet.crc16(body, self._head_crc)
        return b"%b%b%c%c" % (self._head, body, crc & 0xFF, crc >> 8)

    def _pairs(self) -> list[tuple[int, bytes]]:
        ids, values = self._values[::2], self._values[1::2]
        encode = self._register.encode
        return [(one, encode(counts)) for one, counts in zip(ids, values, strict=True)]


class Exchange:
    """Sends the question of every cycle and sorts the answers.

    After `collect`, `data[i]` holds what servo i sent, None where nothing right came, and
    `errors[i]` its error byte.

    Parameters
    ----------
    port : BytePort
        The line.
    clock : Clock
        What waits.
    ids : sequence of int
        The servos, in the order of the axes.
    address, size : int
        The block read of each.
    fast : bool
        One answer for all instead of one each.
    byte_s, return_delay_s, latency_s : float
        Time of a byte, of a servo before it answers, of the adapter before it hands bytes on [s].
    """

    def __init__(
        self,
        port: BytePort,
        clock: Clock,
        ids: Sequence[int],
        address: int,
        size: int,
        *,
        fast: bool,
        baud: int,
        return_delay_s: float,
        latency_s: float,
    ) -> None:
        self._port = port
        self._clock = clock
        self._ids = tuple(ids)
        self._index = {one: index for index, one in enumerate(ids)}
        self._address = address
        self._size = size
        # Data of all FF FF FD would grow by a third.
        self._longest = size + size // 3 + 4
        self._fast = FastStatus(len(ids), size) if fast else None
        answers = len(ids) * (11 + size) if not fast else 8 + len(ids) * (size + 4)
        delays = len(ids) if not fast else 1
        answer_s = answers * BITS_PER_BYTE / baud + delays * return_delay_s + latency_s
        self._answer_ns = round(answer_s * 1e9) + SLACK_NS
        self._byte_ns = round(BITS_PER_BYTE * 1e9 / baud)
        self._buffer = bytearray()
        self._present = [True] * len(ids)
        self._order = self._ids
        self._questions: dict[tuple[int, ...], bytes] = {}
        self._question = self._ask(self._order)
        self._due_ns = 0
        self.stale = 0
        self.data: list[bytes | None] = [None] * len(ids)
        self.errors = [0] * len(ids)

    def send(self, goals: bytes = b"") -> None:
        """Drop what has come, then send the goals and the question.

        Raises
        ------
        DriverError
            The line is gone.
        """
        left = self._port.read()
        self.stale += len(left) + len(self._buffer)
        self._buffer.clear()
        message = goals + self._question if goals else self._question
        self._port.write(message)
        self._due_ns = self._clock.now_ns() + len(message) * self._byte_ns + self._answer_ns

    def collect(self, deadline_ns: int) -> int:
        """Take the answers in as they come; return how many servos are missing.

        Raises
        ------
        DriverError
            The line is gone.
        """
        port, clock, buffer, present = self._port, self._clock, self._buffer, self._present
        count = len(self._ids)
        self.data = [None] * count
        self.errors = [0] * count
        if self._fast is not None:
            self._fast.restart()
        take = self._take if self._fast is None else self._take_fast
        left = count
        while True:
            chunk = port.read()
            if chunk:
                buffer += chunk
                left, last = take(left)
                if left == 0 or last:
                    break
            limit = deadline_ns
            if self._due_ns < limit and not self._awaited():
                limit = self._due_ns
            if not clock.wait(port, limit):
                break
        if left or not all(present):
            self._reorder()
        return left

    def _take(self, left: int) -> tuple[int, bool]:
        """Sort the status packets that are whole; return how many lack, and if the last came."""
        last = False
        while (found := packet.take_packet(self._buffer, self._longest)) is not None:
            index = self._index.get(found[0])
            params = found[2]
            if index is None or found[1] != packet.STATUS or not params:
                continue
            if len(params) == self._size + 1:
                if self.data[index] is None:
                    left -= 1
                self.data[index] = params[1:]
            self.errors[index] = params[0]
            last = found[0] == self._order[-1]
        return left, last

    def _take_fast(self, left: int) -> tuple[int, bool]:
        assert self._fast is not None
        for device_id, error, data in self._fast.take(self._buffer):
            index = self._index.get(device_id)
            if index is not None and self.data[index] is None:
                left -= 1
                self.data[index] = data
                self.errors[index] = error
        return left, False

    def _awaited(self) -> bool:
        """Return whether a servo that answered last time has not answered yet."""
        for data, present in zip(self.data, self._present, strict=True):
            if present and data is None:
                return True
        return False

    def _reorder(self) -> None:
        """Ask those last that did not answer."""
        self._present = [data is not None for data in self.data]
        pairs = list(zip(self._ids, self._present, strict=True))
        here = [one for one, present in pairs if present]
        order = tuple(here + [one for one, present in pairs if not present])
        if order != self._order:
            self._order = order
            self._question = self._ask(order)

    def _ask(self, order: tuple[int, ...]) -> bytes:
        question = self._questions.get(order)
        if question is None:
            question = packet.sync_read_packet(
                order, self._address, self._size, fast=self._fast is not None
            )
            self._questions[order] = question
        return question
