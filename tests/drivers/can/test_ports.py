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
from tautwave.traffic import recorded, tapped
from tautwave_drivers.can.batches import receiving, sending
from tautwave_drivers.can.errors import error_text
from tautwave_drivers.can.framing import ERROR_FRAME, EXTENDED, Echo, Framing
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.can.python_can import (
    PolledPort,
    PythonCanPort,
    open_python_can,
    port_kind,
)
from tautwave_drivers.can.raw import RawPort, filters
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


def test_frames_go_and_come_several_at_once(pair: tuple[RawPort, socket.socket]) -> None:
    port, other = pair
    assert port.send_all([(1, bytes(8)), (2, b"ab")]) == 2
    assert [FRAME.unpack(other.recv(64))[:2] for _ in range(2)] == [(1, 8), (2, 2)]
    for number in range(5):
        other.send(FRAME.pack(number, 2, b"xy"))
    other.send(b"no frame")
    assert [frame[0] for frame in port.receive_some(3)] == [0, 1, 2]
    assert [frame[0] for frame in port.receive_some(9)] == [3, 4]
    assert port.receive_some(9) == []
    with pytest.raises(ValueError, match="9 data bytes"):
        port.send_all([(1, bytes(8)), (2, bytes(9))])


def test_several_frames_stop_at_a_full_queue(pair: tuple[RawPort, socket.socket]) -> None:
    port, _ = pair
    frames = [(number & 0x7FF, bytes(8)) for number in range(20_000)]
    sent = port.send_all(frames)
    assert 0 < sent < len(frames)
    assert port.send_all(frames) == 0


def test_what_came_before_an_interface_went_is_given_first() -> None:
    answers: list[Any] = [FRAME.pack(7, 1, b"z"), OSError(errno.ENETDOWN, "down")]

    def recv(_: int) -> bytes:
        found = answers[0] if len(answers) == 1 else answers.pop(0)
        if isinstance(found, OSError):
            raise found
        return bytes(found)

    broken: Any = SimpleNamespace(setblocking=lambda _: None, send=None, recv=recv)
    port = RawPort(broken, FakeClock(), "can0")
    assert [frame[0] for frame in port.receive_some(4)] == [7]
    with pytest.raises(DriverError, match="can0"):
        port.receive_some(4)


@pytest.mark.parametrize("batches", [True, False])
def test_a_port_without_such_calls_does_one_by_one(
    batches: bool, pair: tuple[RawPort, socket.socket]
) -> None:
    whole, other = pair
    port: Any = whole
    if not batches:
        port = SimpleNamespace(send=whole.send, receive=whole.receive)
    assert sending(port)([(1, b"a"), (2, b"b")]) == 2
    for number in (5, 6):
        other.send(FRAME.pack(number, 0, b""))
    take = receiving(port)
    assert [frame[0] for _ in range(3) for frame in take(1)] == [5, 6]


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
    other.send(FRAME.pack(EXTENDED | 0x181, 8, bytes(8)))
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
        port = port_kind(bus)(bus, MonotonicClock(), "virtual:frames")
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


FD_FRAME = struct.Struct("<IBB2x64s")
FD = Framing(data_bitrate=5_000_000, extended=True)


def datagrams(framing: Framing) -> tuple[RawPort, socket.socket]:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    theirs.setblocking(False)
    return RawPort(ours, FakeClock(5), "pair", framing), theirs


def test_an_fd_port_sends_fd_with_rate_switch_and_knows_who_answers_classic() -> None:
    port, other = datagrams(FD)
    with other:
        assert port.send(EXTENDED | 0x1800FD01, bytes(range(24)))
        # <linux/can.h>, struct canfd_frame: id with CAN_EFF_FLAG, length, CANFD_BRS, 64 of data
        assert other.recv(128) == bytes.fromhex("01fd0098 18 01 0000") + bytes(range(24)) + bytes(
            40
        )
        other.send(FD_FRAME.pack(0x11, 12, 1, b"fd"))
        other.send(FRAME.pack(0x12, 2, b"ok"))
        assert port.receive() == (0x11, b"fd" + bytes(10), 5)
        assert port.receive() == (0x12, b"ok", 5)
        assert port.classic_ids == {0x12}
        port.close()


def test_a_classic_port_takes_no_fd_frame(pair: tuple[RawPort, socket.socket]) -> None:
    port, other = pair
    other.send(FD_FRAME.pack(0x181, 8, 1, bytes(8)))
    other.send(FRAME.pack(0x182, 1, b"a"))
    assert port.receive() == (0x182, b"a", 5)


@pytest.mark.parametrize(
    ("framing", "can_id", "size", "words"),
    [
        (Framing(), 0x1800FD01, 8, "has more bits"),
        (Framing(), EXTENDED | 0x1800FD01, 8, "identifiers of 11 bits"),
        (Framing(), 0x181, 24, "at most 8"),
        (Framing(extended=True), EXTENDED | 0x2000_0000, 8, "has more bits"),
        (FD, 0x181, 9, "no FD frame"),
    ],
)
@pytest.mark.parametrize("kind", ["raw", "python-can"])
def test_a_frame_never_leaves_as_another_one(
    framing: Framing, can_id: int, size: int, words: str, kind: str
) -> None:
    bus = SimpleNamespace(send=lambda message: None, recv=None)
    port: Any = PythonCanPort(bus, FakeClock(), "test", framing)  # type: ignore[arg-type]
    other = None
    if kind == "raw":
        port, other = datagrams(framing)
    with pytest.raises(ValueError, match=words):
        port.send(can_id, bytes(size))
    if other is not None:
        port.close()
        other.close()


def test_a_raw_port_says_whether_it_has_frames_and_when_it_is_gone() -> None:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        port = RawPort(ours, FakeClock(), "test")
        assert not port.has_frames()
        theirs.send(struct.pack("<IB3x8s", 0x11, 8, bytes(8)))
        assert port.has_frames()
        assert port.receive() == (0x11, bytes(8), 0)
        assert not port.has_frames()
        ours.shutdown(socket.SHUT_RDWR)
        assert port.has_frames()  # which makes the next `receive` say it
        port.close()


def test_the_kernels_filters_are_the_ids_and_their_kind() -> None:
    # <linux/can.h>, struct can_filter: id and mask; flags and all bits of the id have to agree
    found = filters(Framing(extended=True, ids=[0x11, EXTENDED | 0x11]))
    assert struct.unpack("<4I", found) == (0x11, 0xC00007FF, 0x80000011, 0xDFFFFFFF)


class Returning:
    """A python-can bus that returns what was sent, as udp_multicast does."""

    def __init__(self) -> None:
        self.here: list[Any] = []
        self.send = self.here.append

    def recv(self, timeout: float) -> Any:
        return self.here.pop(0) if self.here else None


def test_an_echo_is_known_by_content_and_count() -> None:
    bus: Any = Returning()
    clock = FakeClock()
    port = PythonCanPort(bus, clock, "test", FD, echoes=True)
    for _ in range(2):
        port.send(0x11, b"same")
    answer = can.Message(arbitration_id=0x11, data=b"same", is_extended_id=False, is_fd=True)
    other = can.Message(arbitration_id=0x11, data=b"else", is_extended_id=False, is_fd=True)
    bus.here += [other, answer]
    assert [port.receive() for _ in range(3)] == [(0x11, b"else", 0), (0x11, b"same", 0), None]
    port.send(0x11, b"lost")
    bus.here.clear()  # this echo never comes
    clock.sleep_until(1_000_000_000)
    bus.here.append(can.Message(arbitration_id=0x11, data=b"lost", is_extended_id=False))
    assert port.receive() == (0x11, b"lost", 1_000_000_000)


@given(st.lists(st.tuples(st.booleans(), st.integers(0, 2)), max_size=40))
def test_what_others_send_passes_whatever_is_sent_and_heard(events: list[tuple[bool, int]]) -> None:
    echo, sent, heard = Echo(), [0] * 3, [0] * 3
    for ours, content in events:
        if ours:
            echo.sent(content, b"", 0)
            sent[content] += 1
        elif not echo.is_own(content, b"", 0):
            heard[content] += 1
    for content in range(3):
        left = 0
        while echo.is_own(content, b"", 0):
            left += 1
        asked = sum(1 for ours, other in events if not ours and other == content)
        assert asked - heard[content] + left == sent[content]


def test_python_can_drops_ids_that_nobody_waits_for() -> None:
    bus: Any = Returning()
    port = PythonCanPort(bus, FakeClock(), "test", Framing(extended=True, ids=[EXTENDED | 0x11]))
    for number, extended in ((0x11, False), (0x12, True), (0x11, True)):
        bus.here.append(can.Message(arbitration_id=number, is_extended_id=extended, data=b"a"))
    bus.here.append(can.Message(arbitration_id=0x40, is_error_frame=True))
    assert [port.receive() for _ in range(3)] == [
        (EXTENDED | 0x11, b"a", 0),
        (ERROR_FRAME | 0x40, b"", 0),
        None,
    ]


@pytest.mark.parametrize("fd", [False, True])
def test_frames_of_all_kinds_pass_python_cans_virtual_bus(fd: bool) -> None:
    framing = Framing(data_bitrate=5_000_000 if fd else None, extended=True)
    with can.Bus(interface="virtual", channel="kinds") as other:
        bus = can.Bus(interface="virtual", channel="kinds")
        port = port_kind(bus)(bus, FakeClock(), "virtual:kinds", framing)
        assert port.send(EXTENDED | 0x1800FD01, bytes(8))
        message = other.recv(0)
        assert message.arbitration_id == 0x1800FD01
        assert message.is_extended_id
        assert (message.is_fd, message.bitrate_switch) == (fd, fd)
        other.send(message)
        assert port.receive() == (EXTENDED | 0x1800FD01, bytes(8), 0)
        port.close()


def test_a_recorded_port_misses_no_frame_of_a_batch(pair: tuple[RawPort, socket.socket]) -> None:
    """It has no calls for several frames, so that they pass where they are recorded."""
    port, other = pair
    clock = FakeClock()
    with recorded(10.0) as traffic:
        tap = tapped("can", port, clock)
        assert sending(tap)([(1, b"a"), (2, b"b")]) == 2
        for number in (5, 6):
            other.send(FRAME.pack(number, 1, b"z"))
        take = receiving(tap)
        assert [frame[0] for _ in range(2) for frame in take(9)] == [5, 6]
    assert [event.can_id for event in traffic.events] == [1, 2, 5, 6]
    assert tap.fileno() == port.fileno()
