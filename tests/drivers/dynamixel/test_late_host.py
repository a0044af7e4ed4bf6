"""On a host that comes late a servo, or the program that simulates it, is waited for longer."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave_drivers.dynamixel.line.transactions import RESPONSE_S, SPARE, TRIES, PacketLine
from tautwave_drivers.dynamixel.protocol import packet

ANSWER = packet.build(1, packet.STATUS, b"\x00\x01\x02\x03")


class LateClock(FakeClock):
    """A host that is called late whenever time is up."""

    def __init__(self, late_ns: int) -> None:
        super().__init__()
        self.late_ns = late_ns

    def wait(self, transport: Any, deadline_ns: int) -> bool:
        found = super().wait(transport, deadline_ns)
        if not found:
            self._now_ns += self.late_ns
        return found


class SlowServo:
    """Answers each request after a time, the newest only."""

    def __init__(self, clock: FakeClock, after_ns: int | None) -> None:
        self._clock = clock
        self._after_ns = after_ns
        self._at_ns: int | None = None
        self.asked = 0

    def next_event_ns(self) -> int | None:
        return None if self.readable() else self._at_ns

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""

    def readable(self) -> bool:
        return self._at_ns is not None and self._clock.now_ns() >= self._at_ns

    def read(self) -> bytes:
        if not self.readable():
            return b""
        self._at_ns = None
        return ANSWER

    def write(self, data: bytes) -> None:
        self.asked += 1
        self._at_ns = None if self._after_ns is None else self._clock.now_ns() + self._after_ns

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.parametrize(
    ("late_ms", "answers_ms", "found"),
    [(0, 20, True), (0, 100, False), (2, 100, False), (25, 100, True), (200, 400, True)],
)
def test_the_wait_grows_with_the_lateness_that_was_measured(
    late_ms: int, answers_ms: int, found: bool
) -> None:
    clock = LateClock(1_000_000 * late_ms)
    servo = SlowServo(clock, 1_000_000 * answers_ms)
    assert (PacketLine(servo, clock, 57600).ping(1) is not None) is found


@pytest.mark.parametrize(("late_ms", "asked"), [(0, TRIES), (1, TRIES), (1000, TRIES + SPARE)])
def test_who_is_not_there_is_not_waited_for_for_ever(late_ms: int, asked: int) -> None:
    clock = LateClock(1_000_000 * late_ms)
    servo = SlowServo(clock, None)
    assert PacketLine(servo, clock, 57600).ping(1) is None
    assert servo.asked == asked


def test_one_deadline_stays_one_deadline() -> None:
    clock = LateClock(50_000_000)
    servo = SlowServo(clock, None)
    limit_ns = clock.now_ns() + round(1e9 * RESPONSE_S)
    line = PacketLine(servo, clock, 57600)
    assert line.read(1, 0, 2, limit_ns) is None
    assert servo.asked == 1
