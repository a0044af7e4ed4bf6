"""A group of UDP multicast as a bus: python-can's datagrams both ways, and no other ones."""

from __future__ import annotations

import os
import socket
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.clock import MonotonicClock
from tautwave.errors import DriverError
from tautwave.multicast import ERROR, REMOTE, Group, only_its_group
from tautwave_drivers.can.framing import EXTENDED, Framing
from tautwave_drivers.can.multicast import MulticastPort
from tautwave_drivers.can.opening import open_port
from tests.drivers.canopen.benches import block, driver_options, node

can = pytest.importorskip("can")

GROUP = f"239.74.{1 + os.getpid() % 250}.94"
CLOCK = MonotonicClock()
SIZES = (*range(9), 12, 16, 20, 24, 32, 48, 64)

standard = st.integers(0, 0x7FF)
extended = st.integers(0, 0x1FFFFFFF).map(lambda number: EXTENDED | number)
classic = st.tuples(standard | extended, st.binary(max_size=8), st.just(False))
longer = st.sampled_from(SIZES).flatmap(lambda size: st.binary(min_size=size, max_size=size))
frames = classic | st.tuples(standard | extended, longer, st.just(True))


@pytest.fixture(scope="module")
def ends() -> Iterator[tuple[Group, Any]]:
    try:
        group, bus = Group(GROUP, stamped=True), can.Bus(interface="udp_multicast", channel=GROUP)
    except (OSError, can.CanError) as err:
        pytest.skip(f"no multicast here: {err}")
    only_its_group(bus)
    yield group, bus
    group.close()
    bus.shutdown()


def heard(end: Any) -> Any:
    """The next frame that comes, within a minute."""
    until = CLOCK.now_ns() + 60 * 10**9
    while CLOCK.now_ns() < until and CLOCK.wait(end, until):
        if some := end.receive_some(1):
            return some[0]
    raise AssertionError


@settings(deadline=None)
@given(frame=frames)
def test_python_can_hears_what_a_group_sends(
    ends: tuple[Group, Any], frame: tuple[int, bytes, bool]
) -> None:
    group, bus = ends
    assert group.send(*frame)
    message = bus.recv(60.0)
    can_id, data, fd = frame
    assert message.arbitration_id | (EXTENDED if message.is_extended_id else 0) == can_id
    assert (bytes(message.data), message.dlc) == (data, len(data))
    assert (message.is_fd, message.bitrate_switch) == (fd, fd)
    assert not message.is_remote_frame
    assert not message.is_error_frame


@settings(deadline=None)
@given(frame=frames, kind=st.sampled_from([0, 0, 0, REMOTE, ERROR]))
def test_a_group_hears_what_python_can_sends_and_when(
    ends: tuple[Group, Any], frame: tuple[int, bytes, bool], kind: int
) -> None:
    group, bus = ends
    can_id, data, fd = frame
    if kind:
        data, fd = b"", False
    before = CLOCK.now_ns()
    bus.send(
        can.Message(
            arbitration_id=can_id & ~EXTENDED, data=data, is_fd=fd,
            is_extended_id=can_id >= EXTENDED, is_remote_frame=kind == REMOTE,
            is_error_frame=kind == ERROR,
        )
    )  # fmt: skip
    *found, at_ns = heard(group)
    assert found == [can_id | kind, data, fd]
    assert before - 10**6 <= at_ns <= CLOCK.now_ns() + 10**6


def test_frames_alike_but_for_their_data_are_read_without_unpacking(
    ends: tuple[Group, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    group, bus = ends
    for number in range(3):
        bus.send(can.Message(arbitration_id=0x55, data=bytes([number] * 8), is_extended_id=False))
        assert heard(group)[:2] == (0x55, bytes([number] * 8))
        monkeypatch.setattr(group, "_unpack", None)


@given(
    st.binary(max_size=80)
    | st.dictionaries(st.text(max_size=3), st.integers()).map(repr).map(str.encode)
)
def test_a_datagram_that_is_no_frame_is_passed_over(datagram: bytes) -> None:
    assert shut()._unpacked(datagram) is None


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("arbitration_id", -1), ("arbitration_id", 0x800), ("arbitration_id", "1"),
        ("arbitration_id", None), ("arbitration_id", 17.0), ("data", bytes(9)),
        ("data", "text"), ("data", None), ("data", 1 << 40), ("is_fd", ...),
        ("is_extended_id", ...),
    ],
)  # fmt: skip
def test_a_frame_that_no_bus_has_is_passed_over(key: str, value: Any) -> None:
    msgpack = pytest.importorskip("msgpack")
    group = shut()
    said = msgpack.unpackb(b"".join(group._around(0x11, 0, False)))
    assert group._unpacked(msgpack.packb(said)) == (0x11, b"", False)
    said |= {key: value}
    assert group._unpacked(msgpack.packb({k: v for k, v in said.items() if v is not ...})) is None


def shut() -> Group:
    """A group that hears nothing: only what it makes of bytes is asked of it."""
    try:
        group = Group(GROUP)
    except OSError as err:
        pytest.skip(f"no multicast here: {err}")
    group.close()
    return group


@pytest.mark.parametrize("filtered", [True, False])
def test_own_frames_do_not_come_back(filtered: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """By the kernel, or by their address where it refuses."""

    def refuse(*_: Any) -> None:
        raise OSError

    if not filtered:
        monkeypatch.setattr("tautwave.multicast._drop", refuse)
    try:
        ours, theirs = Group(GROUP), Group(GROUP)
    except OSError as err:
        pytest.skip(f"no multicast here: {err}")
    try:
        assert ours.send(0x11, b"same", False)
        assert heard(theirs)[0] == 0x11
        if filtered:
            with pytest.raises(BlockingIOError):
                ours._in.recv(99, socket.MSG_DONTWAIT)
        assert ours.receive_some(9) == []
        assert theirs.send(0x11, b"same", False)  # alike, but another's
        assert heard(ours)[:2] == (0x11, b"same")
    finally:
        ours.close()
        theirs.close()


@pytest.mark.parametrize("fd", [False, True])
def test_a_port_takes_its_kind_of_frames_and_those_it_listens_to(
    ends: tuple[Group, Any], fd: bool
) -> None:
    group, _ = ends
    port = MulticastPort.open(GROUP, CLOCK, Framing(5_000_000 if fd else None))
    wide = MulticastPort.open(GROUP, CLOCK, Framing(None, True, [EXTENDED | 7]))
    try:
        port.listen([5, 6])
        for can_id, is_fd in ((5, True), (6, False), (EXTENDED | 5, False), (7, False), (6, False)):
            group.send(can_id, b"x", is_fd)
        group.send(EXTENDED | 7, b"y", False)
        expected = [5, 6, 6] if fd else [6, 6]
        assert [heard(port)[0] for _ in expected] == expected
        assert port.classic_ids == ({6} if fd else set())
        assert heard(wide)[:2] == (EXTENDED | 7, b"y")
        assert port.has_frames()
        assert port.receive() is None  # only what it does not take
        assert not port.has_frames()
        with pytest.raises(ValueError, match="data bytes"):
            port.send(5, bytes(9))
        assert port.send(5, b"out")
        assert wide.send(EXTENDED | 9, b"far")
    finally:
        port.close()
        wide.close()


def test_a_channel_that_is_no_group_is_one_sentence() -> None:
    options = driver_options(block(node(1)) | {"interface": "udp_multicast", "channel": "10.0.0.1"})
    with pytest.raises(DriverError, match=r"cannot open udp_multicast:10\.0\.0\.1 .*address that"):
        open_port(options, CLOCK)
