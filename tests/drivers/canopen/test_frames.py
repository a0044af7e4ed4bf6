"""Frame ports: a raw socket (on a datagram pair), python-can's virtual bus, errors in words."""

from __future__ import annotations

import errno
import socket
import struct
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.errors import DriverError
from tautwave_drivers.canopen.bus.frames import ERROR_FRAME, RawPort, error_text
from tautwave_drivers.canopen.bus.opening import open_port
from tautwave_drivers.canopen.bus.python_can import (
    PolledPort,
    PythonCanPort,
    open_python_can,
    polled,
)
from tests.drivers.canopen.benches import block, driver_options, node

can = pytest.importorskip("can")

FRAME = struct.Struct("<IB3x8s")


@pytest.fixture
def pair() -> Iterator[tuple[RawPort, socket.socket]]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with theirs:
        theirs.setblocking(False)
        port = RawPort(ours, FakeClock(5), "pair")
        yield port, theirs
        port.close()


def test_a_frame_is_a_struct_can_frame(pair: tuple[RawPort, socket.socket]) -> None:
    port, other = pair
    assert port.send(0x201, b"\x0f\x00\x64\x00")
    # <linux/can.h>: can_id (host order), len, three bytes of padding, eight of data
    assert other.recv(64) == bytes.fromhex("01020000 04 000000 0f00640000000000")
    other.send(bytes.fromhex("81010000 06 000000 37120a0000000000"))
    assert port.receive() == (0x181, bytes.fromhex("37120a000000"), 5)
    assert port.receive() is None


def test_extended_remote_and_cut_frames_are_nobodys(pair: tuple[RawPort, socket.socket]) -> None:
    port, other = pair
    other.send(FRAME.pack(0x80000181, 8, bytes(8)))
    other.send(FRAME.pack(0x40000181, 0, bytes(8)))
    other.send(FRAME.pack(0x182, 8, bytes(8)))
    assert port.receive() == (0x182, bytes(8), 5)
    other.send(b"short")
    assert port.receive() is None


@given(st.binary(max_size=16))
def test_no_datagram_raises(data: bytes) -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with theirs:
        port = RawPort(ours, FakeClock(), "pair")
        theirs.send(data)
        port.receive()
        port.close()


def test_a_full_queue_returns_false_and_drains(pair: tuple[RawPort, socket.socket]) -> None:
    port, other = pair
    sent = 0
    while port.send(0x80, b""):
        sent += 1
        assert sent < 100_000
    assert sent > 0
    while True:
        try:
            other.recv(64)
        except BlockingIOError:
            break
    assert port.send(0x80, b"")


class Refusing:
    """A socket that refuses as the kernel does."""

    def __init__(self, number: int) -> None:
        self.number = number

    def setblocking(self, blocking: bool) -> None:
        """Nothing to set."""

    def send(self, data: bytes) -> int:
        raise OSError(self.number, "refused")

    recv = send  # type: ignore[assignment]

    def fileno(self) -> int:
        return -1


@pytest.mark.parametrize("number", [errno.ENOBUFS, errno.EAGAIN])
def test_no_buffer_space_is_a_full_queue(number: int) -> None:
    port: Any = RawPort(Refusing(number), FakeClock(), "can0")  # type: ignore[arg-type]
    assert not port.send(0x80, b"")


@pytest.mark.parametrize("number", [errno.ENETDOWN, errno.ENODEV, errno.ENXIO])
def test_an_interface_that_is_gone_is_a_sentence(number: int) -> None:
    port: Any = RawPort(Refusing(number), FakeClock(), "can0")  # type: ignore[arg-type]
    for call in (lambda: port.send(0x80, b""), port.receive):
        with pytest.raises(DriverError, match="CAN interface can0 is down or gone"):
            call()


def test_what_waits_in_a_queue_is_counted_where_the_kernel_tells(
    pair: tuple[RawPort, socket.socket],
) -> None:
    port, _ = pair
    assert port.pending() == 0
    port.send(0x80, b"")
    assert port.pending() > 0  # the other end has not read it


@pytest.fixture
def virtual() -> Iterator[tuple[PythonCanPort, Any]]:
    with can.Bus(interface="virtual", channel="frames") as other:
        bus = can.Bus(interface="virtual", channel="frames")
        port = polled(bus, MonotonicClock(), "virtual:frames")
        yield port, other
        port.close()


def test_python_cans_virtual_bus(virtual: tuple[PythonCanPort, Any]) -> None:
    port, other = virtual
    assert isinstance(port, PolledPort)
    assert not callable(port.fileno)
    assert port.send(0x201, b"\x0f\x00")
    message = other.recv(0)
    assert (message.arbitration_id, bytes(message.data)) == (0x201, b"\x0f\x00")
    assert not message.is_extended_id
    assert not port.readable()
    other.send(can.Message(arbitration_id=0x12345, is_extended_id=True))
    other.send(can.Message(arbitration_id=0x181, data=b"\x01", is_extended_id=False))
    clock = MonotonicClock()
    assert clock.wait(port, clock.now_ns() + 1_000_000_000)
    frame = port.receive()
    assert frame is not None
    assert frame[:2] == (0x181, b"\x01")
    assert port.receive() is None


def test_a_flood_of_extended_frames_hides_nothing(virtual: tuple[PythonCanPort, Any]) -> None:
    port, other = virtual
    for number in range(3000):
        other.send(can.Message(arbitration_id=0x10000 + number, is_extended_id=True))
    other.send(can.Message(arbitration_id=0x181, data=b"\x01", is_extended_id=False))
    frame = port.receive()
    assert frame is not None
    assert frame[:2] == (0x181, b"\x01")


def test_error_frames_of_python_can_come_through(virtual: tuple[PythonCanPort, Any]) -> None:
    port, other = virtual
    other.send(can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8)))
    frame = port.receive()
    assert frame is not None
    assert frame[0] == ERROR_FRAME | 0x40


def test_a_closed_bus_is_a_sentence(virtual: tuple[PythonCanPort, Any]) -> None:
    port, _ = virtual
    port.close()
    with pytest.raises(DriverError, match="virtual:frames is down or gone"):
        port.send(0x80, b"")


class FullBus:
    """A python-can bus whose queue is full."""

    def __init__(self, words: str) -> None:
        self.words = words

    def send(self, message: Any) -> None:
        raise can.CanOperationError(self.words)

    recv = send


def test_what_waits_in_python_can_is_discarded_where_that_can_be_done() -> None:
    flushed = []

    def refuse() -> None:
        raise NotImplementedError

    for flush in (lambda: flushed.append(True), refuse):
        bus = SimpleNamespace(send=None, recv=None, flush_tx_buffer=flush)
        PythonCanPort(bus, FakeClock(), "test").purge()
    assert flushed == [True]


def test_a_full_queue_of_python_can() -> None:
    port = PythonCanPort(FullBus("Transmit buffer full"), FakeClock(), "can0")  # type: ignore[arg-type]
    assert not port.send(0x80, b"")
    port = PythonCanPort(FullBus("Network is down"), FakeClock(), "can0")  # type: ignore[arg-type]
    with pytest.raises(DriverError, match="Network is down"):
        port.send(0x80, b"")


def test_the_raw_backend_is_for_socketcan_only() -> None:
    options = driver_options(block(node(1), backend="raw"))
    with pytest.raises(DriverError, match="backend raw is for interface socketcan"):
        open_port(options, FakeClock())


def test_an_interface_that_is_not_there_is_a_sentence() -> None:
    options = driver_options(block(node(1)) | {"interface": "socketcan", "channel": "nocan9"})
    with pytest.raises(DriverError, match=r"nocan9|no SocketCAN"):
        open_port(options, FakeClock())
    with pytest.raises(DriverError, match="cannot open socketcan:nocan9"):
        open_python_can(options, FakeClock())


@pytest.mark.parametrize(
    ("can_id", "data", "words", "lost"),
    [
        (0x40, bytes(8), "bus-off", True),
        (0x04, bytes([0, 0x10] + [0] * 6), "error passive (receiving)", False),
        (0x04, bytes([0, 0x30] + [0] * 6), "error passive (transmitting)", False),
        (0x04, bytes([0, 0x01] + [0] * 6), "receive overflow", False),
        (0x20, bytes(8), "no acknowledge", False),
        (0x100, bytes(8), "controller restarted", False),
        (0x04, b"", "error frame", False),
    ],
)
def test_error_frames_in_words(can_id: int, data: bytes, words: str, lost: bool) -> None:
    reported, gone = error_text(ERROR_FRAME | can_id, data)
    assert words in reported
    assert gone == lost


@given(st.integers(0, 0x1FFFFFFF), st.binary(max_size=8))
def test_every_error_frame_has_words(can_id: int, data: bytes) -> None:
    assert error_text(ERROR_FRAME | can_id, data)[0]
