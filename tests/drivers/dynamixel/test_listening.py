"""Another master on the line is noticed before anything is sent."""

from __future__ import annotations

import os
import pty
import threading
import tty
from contextlib import suppress

import pytest

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers.dynamixel.listening import LISTEN_NS, refuse_another_master
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.serial_port import SerialPort

PING = packet.build(7, packet.PING)
ANSWER = packet.build(7, packet.STATUS, b"\x00\x01\x02\x03")


class Line:
    """A line on which bytes come at a time, in memory."""

    def __init__(self, clock: Clock, data: bytes, at_ns: int) -> None:
        self._clock = clock
        self._data = data
        self._at_ns = at_ns

    def next_event_ns(self) -> int | None:
        return self._at_ns if self._data and not self.readable() else None

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""

    def readable(self) -> bool:
        return bool(self._data) and self._clock.now_ns() >= self._at_ns

    def read(self) -> bytes:
        if not self.readable():
            return b""
        data, self._data = self._data, b""
        return data

    def write(self, data: bytes) -> None:
        raise AssertionError(data)

    def close(self) -> None:
        """Nothing to close."""


@pytest.mark.parametrize(
    ("data", "refused"),
    [
        (PING, True),
        (b"\x00\xff" + ANSWER + PING, True),
        (ANSWER, False),  # late, for a run that was killed
        (PING[:-1], False),
        (b"\x00" * 20, False),  # noise
    ],
)
def test_only_instructions_are_another_master(data: bytes, refused: bool) -> None:
    clock = FakeClock()
    line = Line(clock, data, clock.now_ns() + LISTEN_NS // 2)
    if refused:
        with pytest.raises(DriverError, match=r"bus arm: another master .* \(to id 7\)"):
            refuse_another_master(line, clock, "arm")
    else:
        refuse_another_master(line, clock, "arm")


def test_what_came_before_it_listened_does_not_count() -> None:
    clock = FakeClock()
    refuse_another_master(Line(clock, PING, clock.now_ns()), clock, "arm")


def listen_on(port: SerialPort) -> None:
    for _ in range(100):  # a machine on which the other one does not get to speak
        refuse_another_master(port, MonotonicClock(), "arm")


def test_a_line_that_another_master_drives_gets_no_byte() -> None:
    other, ours = pty.openpty()
    tty.setraw(other)
    over = threading.Event()

    def speak() -> None:
        while not over.wait(0.005):
            with suppress(BlockingIOError):
                os.write(other, PING)

    os.set_blocking(other, False)
    port = SerialPort(os.ttyname(ours), 57600)
    thread = threading.Thread(target=speak)
    thread.start()
    try:
        with pytest.raises(DriverError, match="another master sends instructions"):
            listen_on(port)
        with pytest.raises(BlockingIOError):
            os.read(other, 100)
    finally:
        over.set()
        thread.join()
        port.close()
        os.close(ours)
        os.close(other)
