"""Single transactions with a servo whose answers, or whose host, come late."""

from __future__ import annotations

import pytest

from tautwave.clock import FakeClock
from tautwave_drivers.dynamixel.line.transactions import PacketLine
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.echo import Unechoed
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.line import RESPONSE_S, ServoLine
from tautwave_drivers.protocol1 import READ, checksum
from tests.drivers.test_late_host import host_late

MS = 1_000_000
HELD = {tables.TORQUE: 1, tables.STATUS: 0, tables.TEMPERATURE: 33, tables.VOLTAGE: 74}


HELD_2 = {64: 1, 70: 0, 146: 33}


class LateServo:
    """Answers each read, however old, the same time after it."""

    def __init__(self, clock: FakeClock, after_ns: int) -> None:
        self._clock = clock
        self._after_ns = after_ns
        self._answers: list[tuple[int, bytes]] = []

    def next_event_ns(self) -> int | None:
        return None if self.readable() or not self._answers else self._answers[0][0]

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""

    def readable(self) -> bool:
        return bool(self._answers) and self._clock.now_ns() >= self._answers[0][0]

    def read(self) -> bytes:
        found = b""
        while self.readable():
            found += self._answers.pop(0)[1]
        return found

    def write(self, data: bytes) -> None:
        if data[2:4] == b"\xfd\0":  # protocol 2.0: address at byte 8
            value = bytes((HELD_2[data[8]],))
            answer = packet.build(data[4], packet.STATUS, b"\0" + value)
            self._answers.append((self._clock.now_ns() + self._after_ns, answer))
        elif data[4] == READ:
            values = {register.address: value for register, value in HELD.items()}
            body = bytes((data[2], 3, 0, values[data[5]]))
            answer = b"\xff\xff" + body + bytes((checksum(body),))
            self._answers.append((self._clock.now_ns() + self._after_ns, answer))

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.parametrize("after_ms", [0, 25, 31, 45, 59, 61, 80, 89])
def test_nor_is_that_of_a_dynamixel(after_ms: int) -> None:
    clock = FakeClock()
    line = PacketLine(LateServo(clock, MS * after_ms), clock, 1_000_000)
    for address in (*HELD_2, *HELD_2):
        found = line.read(1, address, 1)
        assert found is not None
        assert found.data[0] == HELD_2[address], address


def line_of(after_ms: int) -> ServoLine:
    clock = FakeClock()
    return ServoLine(Unechoed(LateServo(clock, MS * after_ms)), clock, 1_000_000, 0.0)


@pytest.mark.parametrize("after_ms", [0, 15, 21, 30, 39, 41, 50, 59])
def test_a_late_answer_is_not_taken_for_that_of_another_register(after_ms: int) -> None:
    line = line_of(after_ms)
    for register in (*HELD, *HELD):
        found = line.read(1, register)
        assert found is not None
        assert found.data[0] == HELD[register], str(register)


@pytest.mark.parametrize(
    ("late_ms", "after_ms", "found"), [(0, 300, False), (2, 300, False), (80, 300, True)]
)
def test_the_wait_grows_with_the_lateness_of_the_host(
    monkeypatch: pytest.MonkeyPatch, late_ms: int, after_ms: int, found: bool
) -> None:
    assert after_ms > 3e3 * RESPONSE_S
    host_late(monkeypatch, late_ms)
    assert (line_of(after_ms).read(1, tables.TORQUE) is not None) is found
