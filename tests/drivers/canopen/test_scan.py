"""`scan canopen` on a bus where anything is said: rows of nodes 1 to 127, never an error."""

from __future__ import annotations

import struct
from collections import deque
from random import Random
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.clock import FakeClock
from tautwave_drivers.canopen.scan import ScanOptions, look

OPTIONS = ScanOptions(listen_s=0.01, timeout_s=0.001)
SDO_ANSWERS, HEARTBEATS = 0x580, 0x700

Frame = tuple[int, bytes]


class Babble:
    """A port on which frames lie ready, and a script of what follows each frame that is sent."""

    def __init__(self, ready: list[Frame], answers: list[list[Frame]]) -> None:
        self.frames = deque(ready)
        self.answers = deque(answers)

    def send(self, can_id: int, data: bytes) -> bool:
        if self.answers:
            self.frames.extend(self.answers.popleft())
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        return (*self.frames.popleft(), 0) if self.frames else None

    def close(self) -> None: ...

    def readable(self) -> bool:
        return bool(self.frames)

    def next_event_ns(self) -> int | None:
        return None

    def advance(self, to_ns: int) -> None: ...


def scanned(ready: list[Frame], answers: list[list[Frame]] | None = None) -> list[dict[str, Any]]:
    rows = look(Babble(ready, answers or []), FakeClock(), OPTIONS)
    return [dict(row) for row in rows]


@pytest.mark.parametrize("service", [HEARTBEATS, SDO_ANSWERS, 0x80])
def test_node_0_is_nobody(service: int) -> None:
    frames = [(HEARTBEATS, b"\0"), (SDO_ANSWERS, bytes(8)), (service, bytes(8))]
    assert scanned(frames) == []
    assert [row["node"] for row in scanned([*frames, (HEARTBEATS + 5, b"\5")])] == [5]


SERVICES = (0, 0x80, 0x180, SDO_ANSWERS, 0x600, HEARTBEATS)
HEADS = (0x00, 0x01, 0x10, 0x41, 0x42, 0x43, 0x4F, 0x60, 0x80, 0xA1, 0xC1)
OBJECTS = (0x1000, 0x1001, 0x1008, 0x1018, 0x603F, 0x6041, 0x6061)
SEEDS = st.integers(0, 2**32 - 1)  # drawing each byte by itself would take a hundred times as long


def sdo(dice: Random, index: int, sub: int) -> bytes:
    return struct.pack("<BHB4s", dice.choice(HEADS), index, sub, dice.randbytes(4))


def noise(dice: Random) -> list[Frame]:
    """Up to four frames: of services and nodes that matter, or of any id; whole SDOs among them."""
    frames = []
    for _ in range(dice.randrange(5)):
        known = dice.choice(SERVICES) | dice.choice((0, 1, 2, 127))
        can_id = known if dice.random() < 0.8 else dice.randrange(2**32)
        whole = sdo(dice, dice.choice(OBJECTS), dice.randrange(5))
        frames.append((can_id, whole if dice.random() < 0.5 else dice.randbytes(dice.randrange(9))))
    return frames


@given(SEEDS)
@settings(deadline=None)
def test_no_frames_end_it_in_an_error(seed: int) -> None:
    dice = Random(seed)
    for row in scanned(noise(dice), [noise(dice) for _ in range(200)]):
        assert 1 <= row["node"] <= 127
        assert isinstance(row["nmt"], str)


class Chatterer(Babble):
    """Two nodes that answer every SDO request with anything, so that transfers go on."""

    def __init__(self, seed: int) -> None:
        super().__init__([], [])
        self.dice = Random(seed)

    def send(self, can_id: int, data: bytes) -> bool:
        node = can_id & 0x7F
        if can_id & ~0x7F == 0x600 and node in (1, 2):
            asked, sub = struct.unpack("<xHB4x", data)
            fits = self.dice.random() < 0.5
            answer = sdo(self.dice, asked, sub) if fits else self.dice.randbytes(8)
            self.frames.append((SDO_ANSWERS | node, answer))
        return True


@given(SEEDS)
@settings(deadline=None)
def test_no_answers_end_it_in_an_error(seed: int) -> None:
    rows = look(Chatterer(seed), FakeClock(), OPTIONS)
    assert [row["node"] for row in rows] == [1, 2]


class Endless:
    """Node 5 answers each request 200 us later, and its name's segments never end."""

    def __init__(self) -> None:
        self.due: deque[tuple[int, Frame]] = deque()
        self.frames: deque[tuple[int, bytes, int]] = deque()
        self.now = self.segments = 0

    def send(self, can_id: int, data: bytes) -> bool:
        if can_id != 0x605:
            return True
        if data[0] & 0xE0 == 0x40:
            answer = bytes([0x41, *data[1:4], 255, 255, 255, 255])
        else:  # of a segment, with the toggle bit that was asked for
            self.segments += 1
            answer = bytes([data[0] & 0x10]) + b"without"
        self.due.append((self.now + 200_000, (SDO_ANSWERS | 5, answer)))
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        return self.frames.popleft() if self.frames else None

    def close(self) -> None: ...

    def readable(self) -> bool:
        return bool(self.frames)

    def next_event_ns(self) -> int | None:
        return self.due[0][0] if self.due else None

    def advance(self, to_ns: int) -> None:
        self.now = to_ns
        while self.due and self.due[0][0] <= to_ns:
            at, frame = self.due.popleft()
            self.frames.append((*frame, at))


def test_segments_without_end_do_not_hold_it() -> None:
    port = Endless()
    (row,) = look(port, FakeClock(), OPTIONS)
    assert (row["node"], row["device"]) == (5, None)
    assert row["errors"] == "response to 1008:00 device name never ends"
    assert 0 < port.segments < 200


def test_a_bus_that_is_never_quiet_does_not_hold_it() -> None:
    clock = FakeClock()

    class Flood(Babble):
        def readable(self) -> bool:
            return True

        def receive(self) -> tuple[int, bytes, int] | None:
            clock.sleep_until(clock.now_ns() + 100_000)
            return 0x185, bytes(8), clock.now_ns()

    assert look(Flood([], []), clock, OPTIONS) == []
