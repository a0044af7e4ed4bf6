"""A pseudo-terminal as the host's end of a line: what its other end sets, says and hears."""

from __future__ import annotations

import fcntl
import os
import select
import sys
import termios
from collections.abc import Callable, Iterator

import pytest

from tautwave_drivers.serial_port import SerialPort
from tautwave_sim.wire.pty import Pty

TIOCGEXCL = 0x80045440  # asm-generic/ioctls.h


@pytest.fixture
def pty() -> Iterator[Pty]:
    made = Pty()
    yield made
    made.close()


def all_of(fd: int, read: Callable[[], bytes], count: int = 256) -> bytes:
    """Read `count` bytes, which the kernel hands over when it gets to it."""
    found = b""
    while len(found) < count and select.select([fd], [], [], 5.0)[0]:
        found += read()
    return found


def test_the_baud_rate_is_the_one_that_its_other_end_has_set(pty: Pty) -> None:
    """Also one without a name in termios; of two, the one to send with."""
    fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    settings = termios.tcgetattr(fd)
    settings[4:6] = termios.B57600, termios.B115200
    termios.tcsetattr(fd, termios.TCSANOW, settings)
    assert pty.baud() == 115_200
    os.close(fd)
    port = SerialPort(pty.path, 4_500_000)
    assert pty.baud() == 4_500_000
    port.set_baud(1_234_567)
    assert pty.baud() == 1_234_567
    port.close()


def test_bytes_pass_both_ways_as_they_are(pty: Pty) -> None:
    """Neither echoed nor taken for ends of lines or signals; nothing is there before it is sent."""
    fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    every = bytes(range(256))
    assert pty.read() == b""
    os.write(fd, every)
    assert all_of(pty.fileno(), pty.read) == every
    pty.write(every)
    assert all_of(fd, lambda: os.read(fd, 4096)) == every
    assert pty.read() == b""
    os.close(fd)


def test_what_a_full_buffer_does_not_hold_is_lost(pty: Pty) -> None:
    for _ in range(100):
        pty.write(bytes(4096))
    fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    assert select.select([fd], [], [], 5.0)[0]
    os.close(fd)


def test_a_line_taken_for_oneself_is_shared_again(pty: Pty) -> None:
    fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY)
    fcntl.ioctl(fd, termios.TIOCEXCL)
    taken = [fcntl.ioctl(fd, TIOCGEXCL, bytes(4))]
    pty.share()
    taken.append(fcntl.ioctl(fd, TIOCGEXCL, bytes(4)))
    assert [int.from_bytes(one, sys.byteorder) for one in taken] == [1, 0]
    os.close(fd)


def test_closed_it_is_an_adapter_pulled_out() -> None:
    pty = Pty()
    fd = os.open(pty.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    pty.close()
    with pytest.raises(OSError, match="Input/output error"):
        os.write(fd, b"x")
    os.close(fd)
