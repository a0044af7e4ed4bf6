"""A port behind which the recorded traffic of a bus answers for its devices."""

from __future__ import annotations

import struct
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.traffic import BYTES, LEAVING, Event

PACKET2, PACKET1 = b"\xff\xff\xfd\x00", b"\xff\xff"
"""Of a packet of Dynamixel's protocols 2.0 and 1.0; Feetech has the latter."""
WRITE1 = 3
"""Protocol 1.0: an address, then values; every other instruction has its count second."""
SDO_REQUESTS, SDO_ANSWERS, MIT_REGISTERS = range(0x600, 0x680), 0x80, 0x7FF
NMT, SYNC, HEARTBEATS = 0, 0x80, range(0x701, 0x780)
BOOT_UP, EMCY, TPDOS = b"\0", 1, (3, 5, 7, 9)
"""EMCY and TPDOs are ids over 128."""
UPLOAD, DOWNLOADS = 0x40, range(0x20, 0x40)
WRITTEN, ABORTED, NO_OBJECT = 0x60, 0x80, 0x06020000
REGISTERS_ASKED, NO_ADDRESS = (3, 4, 6, 16, 23), 2
"""Modbus: functions of which one that was not recorded is refused, as an illegal data address."""
READS, ASKED_BYTES = (3, 4), {1: 6, 2: 6, 3: 6, 4: 6, 15: 6, 16: 6, 23: 10}
"""Modbus: what asks for registers, and the bytes of unit, function, addresses and counts."""
AHEAD = 16
"""Of requests that ask for the same, how many are looked at for one with the same values."""
LATEST_NS = 50_000_000
"""What comes later after a request is no answer to it."""


def sent_by_hosts(can_id: int) -> bool:
    """Return whether a CANopen host sends frames with this id: NMT, SYNC, RPDOs, SDO requests."""
    return can_id in (NMT, SYNC) or can_id in SDO_REQUESTS or (can_id >> 7) in (4, 6, 8, 10)


def key_of(can_id: int, data: bytes) -> tuple[Any, ...]:
    """Return what a request asks for, whatever values it carries."""
    if can_id != BYTES:
        if can_id in SDO_REQUESTS or can_id == MIT_REGISTERS:
            return can_id, data[:4]
        return (can_id, data) if can_id == NMT else (can_id,)
    packets = []
    while data.startswith(PACKET2) and len(data) >= 10:
        packets.append((data[4], data[7], data[8:12]))
        data = data[7 + int.from_bytes(data[5:7], "little") :]
    while data.startswith(PACKET1) and not data.startswith(PACKET2) and len(data) >= 6:
        packets.append((data[2], data[4], data[5 : 6 if data[4] == WRITE1 else 7]))
        data = data[4 + data[3] :]
    if packets:
        return tuple(packets)
    line, pdu = ("tcp", data[6:]) if is_tcp(data) else ("rtu", data)
    return line, pdu[: ASKED_BYTES.get(pdu[1], 4) if len(pdu) > 1 else 4]


def is_tcp(data: bytes) -> bool:
    """Return whether bytes are one frame of Modbus TCP."""
    return (
        len(data) >= 8
        and data[2:4] == b"\0\0"
        and len(data) == 6 + int.from_bytes(data[4:6], "big")
    )


class _Exchange(NamedTuple):
    key: tuple[Any, ...]
    sent: bytes
    answers: list[tuple[int, int, bytes]]
    at_ns: int


class _Latest:
    """Which request each recorded frame answers.

    On CANopen several are under way at a time: an SDO between a SYNC and its TPDOs, a heartbeat of
    the host. On a serial line, a socket or a bus of MIT motors the last one is meant.
    """

    def __init__(self) -> None:
        self._by_id: dict[int, _Exchange] = {}
        self._last: _Exchange | None = None

    def sent(self, event: Event, one: _Exchange) -> None:
        self._by_id[event.can_id] = one
        if event.can_id not in HEARTBEATS or self._last is None:
            self._last = one

    def asked(self, event: Event) -> _Exchange | None:
        """Return the request that a received frame answers, None before the first.

        Unrequested frames, heartbeats and EMCY, come with the SYNC before it.
        """
        can_id, last, sync = event.can_id, self._last, self._by_id.get(SYNC)
        if sync is not None and event.at_ns - sync.at_ns > LATEST_NS:
            sync = None
        alive = can_id in HEARTBEATS and event.data != BOOT_UP
        if alive or can_id >> 7 in (*TPDOS, EMCY):
            return sync or last
        if can_id + SDO_ANSWERS in SDO_REQUESTS:
            return self._by_id.get(can_id + SDO_ANSWERS, last)
        return last


def _registers(
    recorded: Mapping[tuple[Any, ...], Sequence[_Exchange]],
) -> dict[tuple[int, int, int], bytes]:
    """Return what the registers of Modbus TCP had last, by unit, function and address."""
    registers = {}
    for key, exchanges in recorded.items():
        if key[0] != "tcp" or len(key[1]) < 6 or key[1][1] not in READS:
            continue
        unit, function, first, count = struct.unpack(">BBHH", key[1][:6])
        for one in exchanges:
            answer = b"".join(data for _, _, data in one.answers)
            if len(answer) == 9 + 2 * count and answer[7] == function:
                for at in range(count):
                    registers[unit, function, first + at] = answer[9 + 2 * at : 11 + 2 * at]
    return registers


class Player:
    """A port behind which recorded traffic answers, in the order in which it was recorded.

    A request is answered as the next one like it was: one with the same bytes soon, else one that
    asks for the same; where none is left, as the last one. One that the recording has none of is
    counted by `unknown`. What then says so without silence is answered: an SDO with its object's
    value, if any was written, or that there is no such object; Modbus TCP with registers that were
    read in other blocks, or an illegal address.
    """

    def __init__(self, events: Sequence[Event], clock: FakeClock) -> None:
        self._clock = clock
        self._coming: list[tuple[int, int, bytes]] = []
        self._waiting: dict[tuple[Any, ...], deque[_Exchange]] = {}
        self._last: dict[tuple[Any, ...], _Exchange] = {}
        self._written: dict[tuple[int, bytes], bytes] = {}
        self.unknown: Counter[str] = Counter()
        self.asked = 0
        self.strayed = False
        """Whether a request got the answer to one with other values."""
        self.left = 0
        """Requests that were recorded and not made yet, before the devices were switched off."""
        leaving = max((k for k, one in enumerate(events) if one.bus == LEAVING), default=None)
        latest = _Latest()
        for event in events[:leaving]:
            if event.bus == LEAVING:  # within a stage devices are opened twice
                continue
            if event.out:
                key = key_of(event.can_id, event.data)
                one = _Exchange(key, event.data, [], event.at_ns)
                self._waiting.setdefault(key, deque()).append(one)
                self.left += 1
                latest.sent(event, one)
            elif (asked := latest.asked(event)) is None:
                self._coming.append((0, event.can_id, event.data))
            elif event.at_ns - asked.at_ns <= LATEST_NS:
                delay_ns = max(0, event.at_ns - asked.at_ns)
                asked.answers.append((delay_ns, event.can_id, event.data))
        self._registers = _registers(self._waiting)
        for each in self._waiting.values():
            if len(each) > 1 and each[-2].answers and not each[-1].answers:
                each.pop()  # its answer is not in the recording any more
                self.left -= 1

    def _ask(self, can_id: int, data: bytes) -> None:
        self.asked += 1
        key = key_of(can_id, data)
        waiting = self._waiting.get(key, deque())
        one = next((each for each in islice(waiting, AHEAD) if each.sent == data), None)
        if one is None:
            one = waiting[0] if waiting else self._last.get(key)
        now = self._clock.now_ns()
        if one is None:
            name = data.hex().upper() if can_id == BYTES else f"{can_id:X}#{data.hex().upper()}"
            self.unknown[name] += 1
            self._coming += [(now, *answer) for answer in self._unrecorded(can_id, data)]
            return
        while waiting and waiting[0] is not one:
            self._last[key] = waiting.popleft()
            self.left -= 1
        if waiting:
            waiting.popleft()
            self.left -= 1
        self._last[key] = one
        first = 2 if key[0] == "tcp" else 0  # after the number of the transaction
        self.strayed = self.strayed or one.sent[first:] != data[first:]
        for delay_ns, answer_id, answer in one.answers:
            body = answer
            if first and len(answer) > first:  # as each server does
                body = data[:first] + answer[first:]
            self._coming.append((now + delay_ns, answer_id, body))
        if can_id in SDO_REQUESTS and any(body[:1] == b"\x60" for _, _, body in one.answers):
            self._written[can_id, data[1:4]] = data

    def _unrecorded(self, can_id: int, data: bytes) -> list[tuple[int, bytes]]:
        """Return what a device says to a request that the recording does not have, if anything."""
        if can_id in SDO_REQUESTS and len(data) == 8:
            written = self._written.get((can_id, data[1:4]))
            if data[0] == UPLOAD and written is not None:
                return [(can_id - SDO_ANSWERS, bytes((written[0] + 0x20,)) + written[1:])]
            if data[0] == UPLOAD or data[0] in DOWNLOADS:
                abort = bytes((ABORTED,)) + data[1:4] + struct.pack("<I", NO_OBJECT)
                return [(can_id - SDO_ANSWERS, abort)]
        if can_id == BYTES and is_tcp(data) and data[7] in REGISTERS_ASKED:
            unit, function, first, count = struct.unpack(">BBHH", data[6:12])
            places = [(unit, function, at) for at in range(first, first + count)]
            if function in READS and all(place in self._registers for place in places):
                body = b"".join(self._registers[place] for place in places)
                known = bytes((unit, function, len(body))) + body
                return [(BYTES, data[:4] + struct.pack(">H", len(known)) + known)]
            refused = bytes((data[6], data[7] | 0x80, NO_ADDRESS))
            return [(BYTES, data[:4] + struct.pack(">H", len(refused)) + refused)]
        return []

    # -- the port -------------------------------------------------------------------------

    def port(self, endpoint: str) -> Player:
        """Return a connection."""
        return self

    def write(self, data: bytes) -> None:
        """Take a request's bytes."""
        self._ask(BYTES, bytes(data))

    def read(self) -> bytes:
        """Return what has come."""
        return b"".join(data for _, _, data in self._due(len(self._coming)))

    def send(self, can_id: int, data: bytes) -> bool:
        """Take a frame."""
        self._ask(can_id, bytes(data))
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame that has come."""
        due = self._due(1)
        return (due[0][1], due[0][2], due[0][0]) if due else None

    def _due(self, count: int) -> list[tuple[int, int, bytes]]:
        now = self._clock.now_ns()
        due = sorted((one for one in self._coming if one[0] <= now), key=lambda one: one[0])[:count]
        for one in due:
            self._coming.remove(one)
        return due

    def next_event_ns(self) -> int | None:
        """Return when something comes [ns]."""
        return min((at for at, _, _ in self._coming), default=None)

    def advance(self, to_ns: int) -> None:
        """Do nothing: traffic has no time of its own."""

    def readable(self) -> bool:
        """Return whether something has come."""
        return any(at <= self._clock.now_ns() for at, _, _ in self._coming)

    def close(self) -> None:
        """Do nothing: no connection is open."""
