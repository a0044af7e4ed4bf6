"""One cycle on the line: one sync write of the goals, one sync read of all servos.

Unlike dynamixel-sdk's group classes: every servo's response counts by itself, a missing one costs
no other; its error byte is kept; packets sent are stuffed; the host waits in the kernel.

Servos respond in the order requested, and some wait for the one before them (in a fast read all
do). So a servo that was silent last time comes last, where it delays no other. A late response may
be the host's fault and is waited for until the deadline; a servo that missed `ABSENT` cycles in a
row is waited for only as long as its response takes on the wire, and an eighth of the time left,
except every `AGAIN`th time.

Responses have no sequence number, so one that is a cycle late could pass for the next. Bytes that
arrive before the request itself has left the wire cannot belong to its response: they are dropped.
If two responses in a cycle have the same id, neither is believed; after a response from a servo
that was not asked, none is.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from tautwave.contracts import BytePort, Clock
from tautwave.types import AxisCommand
from tautwave_drivers.causes import Cause
from tautwave_drivers.dynamixel.bringup import Limits
from tautwave_drivers.dynamixel.budget import BITS_PER_BYTE
from tautwave_drivers.dynamixel.fast_path import FastPath, Values
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.fast import FastStatus
from tautwave_drivers.dynamixel.protocol.messages import OF_OTHERS, cause_of
from tautwave_drivers.dynamixel.protocol.registers import Register
from tautwave_drivers.dynamixel.protocol.units import Scale

SLACK_NS = 100_000
"""Beyond its wire time, for an absent servo: turn-around and host."""

WORD = struct.Struct("<H")

ABSENT = 3
AGAIN = 8


class Timing(NamedTuple):
    """Baud rate; return delay of a servo, latency of the adapter [s]."""

    baud: int
    return_delay_s: float
    latency_s: float


class Goals:
    """The sync write of one register of some servos, with values that change.

    Parameters
    ----------
    register : Register
        What is written.
    ids : sequence of int
        Of these servos.
    """

    def __init__(self, register: Register, ids: Sequence[int]) -> None:
        self._register = register
        self._values = [number for one in ids for number in (one, 0)]
        self._body = struct.Struct("<" + ("Bh" if register.size == 2 else "Bi") * len(ids))
        whole = packet.sync_write_packet(register.address, register.size, self._pairs())
        self._head = whole[: -2 - self._body.size]
        self._crc = packet.FixedCrc(self._body.size)
        self._crc_start = self._crc.start(packet.crc16(self._head))

    def put(self, index: int, counts: int) -> None:
        """Set the value of the `index`-th servo, for the packets to come."""
        self._values[2 * index + 1] = counts

    def packet(self) -> bytes:
        """Return the sync write."""
        body = self._body.pack(*self._values)
        if packet.PATTERN in body:
            pairs = self._pairs()
            return packet.sync_write_packet(self._register.address, self._register.size, pairs)
        return self._head + body + WORD.pack(self._crc(body, self._crc_start))

    def _pairs(self) -> list[tuple[int, bytes]]:
        ids, values = self._values[::2], self._values[1::2]
        encode = self._register.encode
        return [(one, encode(counts)) for one, counts in zip(ids, values, strict=True)]


class Exchange:
    """Sends the request of every cycle and sorts the responses.

    After `collect`, `values[i]` holds what servo i sent, None without a valid response;
    `refusals` the error bytes of responses without data, by index; `returned` the servos that are
    back and after how many missed cycles, until the reader clears it. With `on_wire` set, bytes
    that arrive sooner than the wire allows are dropped; without, only those before the request.

    Parameters
    ----------
    port : BytePort
        The line.
    clock : Clock
        What waits.
    ids : sequence of int
        The servos, in the order of the axes.
    address : int
        Where the block read of each begins.
    fields : str
        What it holds, as `struct` names it.
    timing : Timing
        Of the line.
    fast : bool
        One response for all (fast sync read) instead of one each.
    """

    def __init__(
        self,
        port: BytePort,
        clock: Clock,
        ids: Sequence[int],
        address: int,
        fields: str,
        timing: Timing,
        *,
        fast: bool,
    ) -> None:
        self._port = port
        self._clock = clock
        self._ids = tuple(ids)
        self._index = {one: index for index, one in enumerate(ids)}
        self._address = address
        self._layout = struct.Struct("<B" + fields)
        self._size = size = self._layout.size - 1
        # Data of all FF FF FD would grow by a third.
        self._longest = size + size // 3 + 4
        self._fast = FastStatus(len(ids), size) if fast else None
        self._fast_path = FastPath(ids, fields, fast=fast)
        delays = 1 if fast else len(ids)
        response_s = delays * timing.return_delay_s + timing.latency_s
        self._byte_ns = round(BITS_PER_BYTE * 1e9 / timing.baud)
        self._wire_ns = self._fast_path.size * self._byte_ns
        self._block_ns = (11 + self._size) * self._byte_ns
        self._response_ns = self._wire_ns + round(response_s * 1e9) + SLACK_NS
        self._buffer = bytearray()
        self._missed = [0] * len(ids)
        self._order = self._ids
        self._requests: dict[tuple[int, ...], bytes] = {}
        self._request = self._request_for(self._order)
        self._sent_ns = 0
        self._due_ns = 0
        self._earliest_ns = 0
        self._complete = False
        self._settled = False
        self.on_wire = False
        self.stale = 0
        self.values: list[Values | None] = [None] * len(ids)
        self.refusals: dict[int, int] = {}
        self.returned: list[tuple[int, int]] = []
        self.wrong: list[Counter[Cause]] = [Counter() for _ in ids]
        """What came instead of each servo's samples since the last one, by cause."""
        self._heard = bytearray()
        self._doubtful: set[int] = set()

    def send(self, goals: bytes, now_ns: int) -> None:
        """Drop what has come, then send the goals and the request.

        Raises
        ------
        DriverError
            The line is lost.
        """
        if not self._settled:  # a late response may have left the right one behind it
            self.stale += len(self._port.read()) + len(self._buffer)
            self._buffer.clear()
        message = goals + self._request
        self._port.write(message)
        self._sent_ns = now_ns + len(message) * self._byte_ns
        self._due_ns = self._sent_ns + self._response_ns
        self._earliest_ns = self._sent_ns if self.on_wire else now_ns

    @property
    def due_ns(self) -> int:
        """When the last response is in, if none is late [ns]."""
        return self._due_ns

    def takes_wire_time(self, now_ns: int) -> bool:
        """Return whether a complete response that has just come took as long as on a wire."""
        margin_ns = self._wire_ns // 10
        return now_ns >= self._sent_ns + self._wire_ns - margin_ns

    def collect(self, deadline_ns: int) -> int:
        """Take the responses as they come; return how many servos are missing.

        Raises
        ------
        DriverError
            The line is lost.
        """
        if self._complete and self._clock.wait(self._port, deadline_ns):
            chunk = self._port.read()
            if self._clock.now_ns() >= self._earliest_ns:
                values = self._fast_path.take(chunk)
                if values is not None:
                    self._settled = True
                    self.values = values  # type: ignore[assignment]  # it is never written to
                    return 0
                self._buffer += chunk
            else:
                self.stale += len(chunk)
        return self._collect_bytewise(deadline_ns)

    def _collect_bytewise(self, deadline_ns: int) -> int:
        """Take the responses byte by byte, whatever is between them."""
        port, clock, buffer = self._port, self._clock, self._buffer
        left = len(self._ids)
        self._heard[:] = buffer
        self._settled = False
        self.values = [None] * left
        self.refusals.clear()
        self._doubtful.clear()
        if self._fast is not None:
            self._fast.restart()
        take = self._take if self._fast is None else self._take_fast
        limit = deadline_ns
        # A slow bus has the time to hear one that is back but not as quick as the wire.
        due_ns = self._due_ns + max(0, (deadline_ns - self._sent_ns) // 8 - SLACK_NS)
        while True:
            chunk = port.read()
            if chunk and clock.now_ns() < self._earliest_ns:
                self.stale += len(chunk)
            else:
                buffer += chunk
                self._heard += chunk
                left, last = take(left)
                if left == 0:
                    break
                if last:  # another may follow if two servos share this id
                    limit = min(limit, clock.now_ns() + self._block_ns + SLACK_NS)
            if due_ns < limit and not self._still_waiting():
                limit = due_ns
            if not clock.wait(port, limit):
                break
        for index in self._doubtful:
            self.values[index] = None
        if self._doubtful:
            left = self.values.count(None)
        self._count_wrong()
        self._reorder()
        self._complete = left == 0 and self._order == self._ids and not buffer
        return left

    def _count_wrong(self) -> None:
        """Count what came instead of samples."""
        for index, values in enumerate(self.values):
            if values is not None:
                self.wrong[index].clear()
            elif not self.refusals.get(index, 0) & ~packet.ALERT:
                cause = cause_of(self._heard, self._ids[index], self._index)
                if cause is None and index in self._doubtful:
                    cause = OF_OTHERS
                if cause is not None:
                    self.wrong[index][cause] += 1

    def _take(self, left: int) -> tuple[int, bool]:
        """Sort the complete status packets; return how many are missing, and if the last came."""
        last = False
        while (response := packet.take_packet(self._buffer, self._longest)) is not None:
            index = self._index.get(response.device_id)
            if response.instruction != packet.STATUS or not response.params:
                continue
            if index is None:
                self._doubtful.update(range(len(self._ids)))
                continue
            if len(response.params) == self._size + 1:
                left -= self._keep(index, response.params)
            else:
                self.refusals[index] = response.error
            last = response.device_id == self._order[-1]
        return left, last

    def _keep(self, index: int, params: bytes) -> bool:
        """Take one servo's sample; return whether it is its first in this cycle."""
        if self.values[index] is not None:
            self._doubtful.add(index)
            return False
        self.values[index] = self._layout.unpack(params)
        return True

    def _take_fast(self, left: int) -> tuple[int, bool]:
        assert self._fast is not None
        for device_id, error, data, place in self._fast.take(self._buffer):
            index = self._index.get(device_id)
            if index is None or self._order[place] != device_id:
                self._doubtful.update(range(len(self._ids)))
            else:
                left -= self._keep(index, bytes((error,)) + data)
        if left == 0:
            self._buffer.clear()
        return left, False

    def _still_waiting(self) -> bool:
        """Return whether a response is missing from a servo that is not absent."""
        for values, missed in zip(self.values, self._missed, strict=True):
            if values is None and (missed < ABSENT or missed % AGAIN == 0):
                return True
        return False

    def _reorder(self) -> None:
        """Put silent servos last, and the first of them behind the others.

        That one may have silenced those that wait for it; each of them gets its turn.
        """
        here: list[int] = []
        silent: list[int] = []
        for one in self._order:
            index = self._index[one]
            received = self.values[index] is not None
            if received and self._missed[index]:
                self.returned.append((index, self._missed[index]))
            self._missed[index] = 0 if received else self._missed[index] + 1
            (here if received else silent).append(one)
        here.sort(key=self._index.__getitem__)
        order = (*here, *silent[1:], *silent[:1])
        if order != self._order:
            self._order = order
            self._request = self._request_for(order)

    def _request_for(self, order: tuple[int, ...]) -> bytes:
        request = self._requests.get(order)
        if request is None:
            request = packet.sync_read_packet(
                order, self._address, self._size, fast=self._fast is not None
            )
            self._requests[order] = request
        return request


class Staging:
    """The goals of all servos on a line.

    Positions are sent from the first that is commanded on: until then a servo holds where torque
    found it.

    Parameters
    ----------
    servos, scales, limits : sequences
        Per axis the servo, its units and its greatest goals.
    """

    def __init__(
        self, servos: Sequence[Servo], scales: Sequence[Scale], limits: Sequence[Limits]
    ) -> None:
        currents: list[int] = []
        velocities: list[int] = []
        positions: list[int] = []
        for at, servo in enumerate(servos):
            follows = servo.axis.takes_position
            (positions if follows else currents if servo.impedance else velocities).append(at)
        self._goals: list[Goals] = []
        self._staged: list[tuple[int, Goals, int, Callable[[AxisCommand, int], int], int]] = []
        for register, some in ((reg.GOAL_CURRENT, currents), (reg.GOAL_VELOCITY, velocities)):
            if not some:
                continue
            goals = Goals(register, [servos[at].options.id for at in some])
            self._goals.append(goals)
            for place, at in enumerate(some):
                counts, limit = scales[at].velocity_counts, limits[at].velocity
                if register is reg.GOAL_CURRENT:
                    counts, limit = scales[at].current_counts, limits[at].current
                self._staged.append((at, goals, place, counts, limit))
        self._followers = [(at, scales[at].position_counts) for at in positions]
        self._places = Goals(reg.GOAL_POSITION, [servos[at].options.id for at in positions])
        self._placed = False

    def put(self, commands: Sequence[AxisCommand]) -> None:
        """Take one command per axis."""
        for at, goals, place, counts, limit in self._staged:
            goals.put(place, counts(commands[at], limit))
        if self._followers and all(
            math.isfinite(commands[at].position) for at, _ in self._followers
        ):
            for place, (at, count) in enumerate(self._followers):
                self._places.put(place, count(commands[at].position))
            self._placed = True

    def packet(self) -> bytes:
        """Return the sync writes."""
        goals = self._goals
        if self._placed:
            return b"".join(g.packet() for g in (*goals, self._places))
        return goals[0].packet() if len(goals) == 1 else b"".join(g.packet() for g in goals)

    def zero(self) -> None:
        """No current, no velocity; positions stay as they are."""
        self._placed = False
        for _, goals, place, _, _ in self._staged:
            goals.put(place, 0)
