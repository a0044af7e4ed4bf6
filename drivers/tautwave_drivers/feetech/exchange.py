"""One cycle on the line: one sync write of the goals, one sync read of all servos.

Servos answer in the order asked, and each waits for the one before it: one that was silent last
time comes last, where it delays no other. Answers have no sequence number. Bytes that come before
the request itself has left the wire belong to an older one and are dropped. If two answers in a
cycle have one id, neither is believed; after one from a servo that was not asked, none is.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Collection, Sequence
from typing import NamedTuple

from tautwave.contracts import Clock
from tautwave_drivers import protocol1
from tautwave_drivers.causes import Cause
from tautwave_drivers.echo import Unechoed
from tautwave_drivers.feetech.line import BITS_PER_BYTE
from tautwave_drivers.feetech.tables import CYCLE, Register

SLACK_NS = 200_000
"""Beyond its time, for a servo that is absent: the host."""
ABSENT, AGAIN = 3, 8
"""Cycles after which a silent servo counts as absent; how often it is waited for then."""

FIELDS = struct.Struct("<BBHHHHxxxxxBHHHBBxBBxxH")
"""`CYCLE`: torque, acceleration, goals of position and effort, goal speed, torque limit, lock,
position, speed, load, voltage, temperature, status, moving, current."""
assert FIELDS.size == CYCLE.size

BAD = Cause(
    "with a wrong checksum", "check cable, plugs, supply and baud rate, and for a second master"
)
OF_LENGTH = Cause("of another length", "is another program on the line?")
TWICE = Cause("from two servos with one id", "give one of them another id")
OF_OTHERS = Cause("of servos that were not asked", "give each servo its own id")
NO_PACKETS = Cause("no packets of protocol 1", "check baud, and that these are Feetech servos")


class Sample(NamedTuple):
    """What one servo answered [counts, as its registers hold them], and its error byte."""

    torque: int
    acceleration: int
    goal_position: int
    goal: int
    goal_speed: int
    torque_limit: int
    lock: int
    position: int
    speed: int
    load: int
    voltage: int
    temperature: int
    status: int
    moving: int
    current: int
    error: int


class Timing(NamedTuple):
    """Baud rate; delay of a servo's answer, latency of the adapter [s]."""

    baud: int
    delay_s: float
    latency_s: float


class Goals:
    """The sync write of a register of some servos, with values that change.

    Parameters
    ----------
    places : sequence
        Id and register of each: at one address, with its own sign.
    """

    def __init__(self, places: Sequence[tuple[int, Register]]) -> None:
        self._places = places
        self._pairs = struct.Struct("<" + "BH" * len(places))
        self.held = [0] * len(places)
        """As the registers hold them."""

    def put(self, index: int, value: int) -> None:
        """Set the value of the `index`-th servo, for the packets to come."""
        self.held[index] = int.from_bytes(self._places[index][1].encode(value), "little")

    def packet(self) -> bytes:
        """Return the sync write."""
        pairs = zip(self._places, self.held, strict=True)
        data = self._pairs.pack(*(number for (one, _), held in pairs for number in (one, held)))
        first = self._places[0][1]
        params = bytes((first.address, first.size)) + data
        return protocol1.build(protocol1.BROADCAST, protocol1.SYNC_WRITE, params)


class Exchange:
    """Sends the request of every cycle and sorts the answers.

    After `collect`, `samples[i]` is what servo i sent, None without a valid answer. With `on_wire`
    set, bytes that come sooner than the wire allows are dropped.

    Parameters
    ----------
    port : Unechoed
        The line.
    clock : Clock
        What waits.
    ids : sequence of int
        The servos, in the order of the axes.
    timing : Timing
        Of the line.
    """

    def __init__(self, port: Unechoed, clock: Clock, ids: Sequence[int], timing: Timing) -> None:
        self._port = port
        self._clock = clock
        self._ids = tuple(ids)
        self._index = {one: index for index, one in enumerate(ids)}
        self._byte_ns = round(BITS_PER_BYTE * 1e9 / timing.baud)
        self._each = CYCLE.size + protocol1.HEAD + 1
        self._wire_ns = len(ids) * self._each * self._byte_ns
        delays_s = len(ids) * timing.delay_s + timing.latency_s
        self._response_ns = self._wire_ns + round(1e9 * delays_s) + SLACK_NS
        self._heads = [protocol1.HEADER + bytes((one, CYCLE.size + 2)) for one in ids]
        self._missed = [0] * len(ids)
        self._order = self._ids
        self._request = protocol1.sync_read_packet(self._order, CYCLE.address, CYCLE.size)
        self._heard = bytearray()
        self._sent_ns = self._earliest_ns = 0
        self.on_wire = False
        self.samples: list[Sample | None] = [None] * len(ids)
        self.wrong: list[Counter[Cause]] = [Counter() for _ in ids]
        """What came instead of each servo's sample since the last one, by cause."""

    def send(self, goals: bytes, now_ns: int) -> None:
        """Drop what has come, then send the goals and the request.

        Raises
        ------
        DriverError
            The line is lost.
        """
        self._port.read()
        self._heard.clear()
        message = goals + self._request
        self._port.write(message)
        self._sent_ns = now_ns + len(message) * self._byte_ns
        self._earliest_ns = self._sent_ns if self.on_wire else now_ns

    def takes_wire_time(self, now_ns: int) -> bool:
        """Return whether a complete answer that has just come took as long as on a wire."""
        return now_ns >= self._sent_ns + self._wire_ns - self._wire_ns // 10

    def collect(self, deadline_ns: int) -> int:
        """Take the answers as they come; return how many servos are missing.

        Raises
        ------
        DriverError
            The line is lost.
        """
        port, clock, heard = self._port, self._clock, self._heard
        whole = len(self._ids) * self._each
        if self._order == self._ids:
            while len(heard) < whole and clock.wait(port, deadline_ns):
                chunk = port.read()
                if clock.now_ns() >= self._earliest_ns:
                    heard += chunk
                if len(heard) < whole and self._waits_in_vain():
                    break
            if len(heard) == whole and self._take_whole():
                return 0
        return self._collect_packets(deadline_ns)

    def _waits_in_vain(self) -> bool:
        """Return whether what is here cannot become the answer that a cycle without fault has."""
        head = self._heads[min(len(self._heard) // self._each, len(self._heads) - 1)]
        at = len(self._heard) // self._each * self._each
        some = self._heard[at : at + len(head)]
        return bytes(some) != head[: len(some)] or any(self._missed)

    def _take_whole(self) -> bool:
        """Take the answers of all servos at once; False where anything differs."""
        each, heard = self._each, self._heard
        samples = []
        for at, head in zip(range(0, len(heard), each), self._heads, strict=True):
            last = at + each - 1
            if heard[at : at + 4] != head or ~sum(heard[at + 2 : last]) & 0xFF != heard[last]:
                return False
            fields = FIELDS.unpack_from(heard, at + protocol1.HEAD)
            samples.append(Sample._make((*fields, heard[at + 4])))
        self.samples[:] = samples
        self._settle()
        return True

    def _collect_packets(self, deadline_ns: int) -> int:
        """Take the answers packet by packet, whatever is between them."""
        port, clock, heard = self._port, self._clock, self._heard
        self.samples[:] = [None] * len(self._ids)
        doubtful: set[int] = set()
        buffer = bytearray(heard)
        due_ns = self._sent_ns + self._response_ns
        due_ns += max(0, (deadline_ns - self._sent_ns) // 8)
        while True:
            self._sort(buffer, doubtful)
            waited = self._still_waiting()
            limit = deadline_ns if waited else min(deadline_ns, due_ns)
            if None not in self.samples:
                # Another may follow, if two servos share an id.
                each_ns = self._each * self._byte_ns
                limit = min(limit, clock.now_ns() + each_ns + SLACK_NS)
            if not clock.wait(port, limit):
                break
            chunk = port.read()
            if clock.now_ns() >= self._earliest_ns:
                heard += chunk
                buffer += chunk
        for index in doubtful:
            self.samples[index] = None
        self._settle(doubtful)
        return self.samples.count(None)

    def _sort(self, buffer: bytearray, doubtful: set[int]) -> None:
        while (response := protocol1.take_packet(buffer)) is not None:
            index = self._index.get(response.device_id)
            if index is None:
                doubtful.update(range(len(self._ids)))
            elif len(response.data) == CYCLE.size:
                if self.samples[index] is not None:
                    doubtful.add(index)
                self.samples[index] = Sample._make((*FIELDS.unpack(response.data), response.error))

    def _still_waiting(self) -> bool:
        """Return whether an answer is missing from a servo that is not absent."""
        return any(
            sample is None and (missed < ABSENT or missed % AGAIN == 0)
            for sample, missed in zip(self.samples, self._missed, strict=True)
        )

    def _settle(self, doubtful: Collection[int] = ()) -> None:
        """Count what came instead of samples; put silent servos last, in turns."""
        here: list[int] = []
        silent: list[int] = []
        for index, (one, sample) in enumerate(zip(self._ids, self.samples, strict=True)):
            if sample is not None:
                if self._missed[index]:
                    self._missed[index] = 0
                    self.wrong[index].clear()
                here.append(one)
                continue
            self._missed[index] += 1
            silent.append(one)
            cause = cause_of(self._heard, one, self._index)
            if cause is None and index in doubtful:
                cause = OF_OTHERS
            if cause is not None:
                self.wrong[index][cause] += 1
        first = self._missed[self._index[silent[0]]] % max(len(silent), 1) if silent else 0
        order = (*here, *silent[first:], *silent[:first])
        if order != self._order:
            self._order = order
            self._request = protocol1.sync_read_packet(order, CYCLE.address, CYCLE.size)


def cause_of(heard: bytes | bytearray, device_id: int, asked: Collection[int]) -> Cause | None:
    """Return why what came in a cycle has no sample of a servo that was asked; None: silence."""
    at = heard.find(protocol1.HEADER)
    if at < 0:
        return NO_PACKETS if heard else None
    seen: set[int] = set()
    strange: Cause | None = None
    while at >= 0 and len(heard) > at + 3:
        who, end = heard[at + 2], at + 4 + heard[at + 3]
        whole = end <= len(heard)
        intact = whole and protocol1.checksum(heard[at + 2 : end - 1]) == heard[end - 1]
        if not intact:
            if who == device_id:
                return BAD if whole else OF_LENGTH
        elif who == device_id:
            if who in seen:
                return TWICE
            strange = OF_LENGTH
        elif who not in asked:
            strange = Cause(f"of servo {who}, which was not asked", "give each servo its own id")
        seen.add(who)
        at = heard.find(protocol1.HEADER, end if intact else at + 1)
    return strange
