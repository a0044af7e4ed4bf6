"""A group of UDP multicast as a wire of CAN, in the datagrams of python-can's `udp_multicast`.

Groups are kept apart: one group is one wire.
"""

from __future__ import annotations

import ctypes
import socket
import struct
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

_ALL_GROUPS = {
    socket.AF_INET: (socket.IPPROTO_IP, 49),  # IP_MULTICAST_ALL, <linux/in.h>
    socket.AF_INET6: (socket.IPPROTO_IPV6, 29),  # IPV6_MULTICAST_ALL, <linux/in6.h>
}

PORT = 43113
"""Of python-can; every group has it."""
_HOPS = {
    socket.AF_INET: (socket.IPPROTO_IP, socket.IP_MULTICAST_TTL),
    socket.AF_INET6: (socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_HOPS),
}
_SO_ATTACH_FILTER, _SO_TIMESTAMPNS = 26, 35  # <asm-generic/socket.h>
_OP = struct.Struct("@HBBI")  # struct sock_filter, <linux/filter.h>
_LOAD_HALF, _LOAD_WORD, _EQUAL, _RETURN = 0x28, 0x20, 0x15, 0x06
_NETWORK = -0x100000  # SKF_NET_OFF
_TIMESPEC = struct.Struct("@ll")
_EXTRA = socket.CMSG_SPACE(_TIMESPEC.size)
_LONGEST = 4096
_KEPT = 1024
_SIZE = 8
"""Data bytes of the frames that are read by what stands around them."""

_AFTER = b"\xa5is_fd"
_TAIL = len(_AFTER + b"?\xaebitrate_switch?\xb5error_state_indicator?")
"""Bytes behind the data, whatever their values are."""
_DATA_AT = _TAIL + _SIZE

EXTENDED, REMOTE, ERROR = 0x80000000, 0x40000000, 0x20000000
"""Bits of an identifier, as on Linux: 29 bits, a remote frame, an error frame."""

_LAST, _LAST_EXTENDED = 0x7FF, 0x1FFFFFFF
_BITS = ("is_extended_id", EXTENDED), ("is_remote_frame", REMOTE), ("is_error_frame", ERROR)

GroupFrame = tuple[int, bytes, bool, int]
"""Identifier with its bits, data, whether it is an FD frame, when the kernel got it [ns]
by the monotonic clock, 0 where that is not known."""

MANY = 10_000
"""Frames that may have come since a bus was opened."""


def only_its_group(bus: Any) -> None:
    """Keep frames of other multicast groups away: Linux hands them to every socket of the port.

    Both ends of a wire have to: devices that hear a second group obey two masters.

    Parameters
    ----------
    bus : can.BusABC
        An open bus; one that is not `udp_multicast` is left as it is.
    """
    port = getattr(getattr(bus, "_multicast", None), "_socket", None)
    if not isinstance(port, socket.socket):
        return
    kind, option = _ALL_GROUPS[port.family]
    with suppress(OSError):  # not Linux: there only the groups joined arrive
        port.setsockopt(kind, option, 0)
        for _ in range(MANY):  # until now those of others came, too; ends where there is none
            port.recv(1, socket.MSG_DONTWAIT)


class Group:
    """One group of UDP multicast as a wire: frames as python-can's `udp_multicast` writes them.

    Other processes of this host or its network hear them, python-can's among them. Own frames do
    not come back: they have a socket of their own, whose address is known.

    Parameters
    ----------
    channel : str
        The group's address, IPv4 or IPv6.
    stamped : bool
        Note when the kernel got each frame.

    Raises
    ------
    OSError
        There is no such group, or no network that could have it.
    ImportError
        msgpack is missing.
    """

    def __init__(self, channel: str, *, stamped: bool = False) -> None:
        import msgpack  # an extra

        self._pack: Callable[[Any], bytes] = msgpack.packb
        self._unpack: Callable[[bytes], Any] = msgpack.unpackb
        self._failure: type[Exception] = msgpack.UnpackException
        self._ends: dict[tuple[int, int, bool], tuple[bytes, bytes]] = {}
        self._kinds: dict[bytes, tuple[int, bool]] = {}
        family, _, _, _, address = socket.getaddrinfo(channel, PORT, type=socket.SOCK_DGRAM)[0]
        with ExitStack() as opened:
            self._in, self._out = (
                opened.enter_context(socket.socket(family, socket.SOCK_DGRAM)) for _ in range(2)
            )
            _join(self._in, family, address)
            if stamped:
                self._in.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
            level, hops = _HOPS[family]
            self._out.setsockopt(level, hops, 1)  # as python-can: no router passes it on
            self._out.connect(address)
            self._in.setblocking(False)
            self._out.setblocking(False)
            self._own = self._out.getsockname()
            with suppress(OSError):  # without the filter they are told by their address
                _drop(self._in, family, self._own)
            opened.pop_all()
        self._send, self._receive = self._out.send, self._in.recvmsg
        self._extra = _EXTRA if stamped else 0

    def fileno(self) -> int:
        """Return the descriptor that is readable when there is something to take."""
        return self._in.fileno()

    def send(self, can_id: int, data: bytes, fd: bool) -> bool:
        """Send a frame, an FD one with rate switch; False where there is no room.

        Raises
        ------
        OSError
            The network is down.
        """
        key = can_id, len(data), fd
        ends = self._ends.get(key)
        if ends is None:
            if len(self._ends) >= _KEPT:  # RobStride's ids carry numbers
                self._ends.clear()
            ends = self._ends[key] = self._around(*key)
        try:
            self._send(ends[0] + data + ends[1])
        except BlockingIOError:
            return False
        return True

    def _around(self, can_id: int, size: int, fd: bool) -> tuple[bytes, bytes]:
        """Return what stands before and after the data of a frame."""
        whole = self._pack(
            {
                "timestamp": 0.0,
                "arbitration_id": can_id & ~EXTENDED,
                "is_extended_id": bool(can_id & EXTENDED),
                "is_remote_frame": False,
                "is_error_frame": False,
                "channel": None,
                "dlc": size,
                "data": bytes(size),
                "is_fd": fd,
                "bitrate_switch": fd,
                "error_state_indicator": False,
            }
        )
        end = whole.index(_AFTER)
        return whole[: end - size], whole[end:]

    def receive_some(self, most: int) -> list[GroupFrame]:
        """Return frames of others that have arrived, oldest first, `most` at most.

        A datagram that does not hold a frame is passed over.

        Raises
        ------
        OSError
            The network is down.
        """
        own, kinds = self._own, self._kinds
        ahead_ns = time.time_ns() - time.monotonic_ns() if self._extra else 0
        frames: list[GroupFrame] = []
        try:
            while len(frames) < most:
                got, extra, _, sender = self._receive(_LONGEST, self._extra)
                if sender == own:
                    continue
                # Of two frames that differ in their data alone, the second needs no unpacking.
                around, data = got[:-_DATA_AT] + got[-_TAIL:], got[-_DATA_AT:-_TAIL]
                kind = kinds.get(around)
                if kind is None:
                    frame = self._unpacked(got)
                    if frame is None:
                        continue
                    kind = frame[0], frame[2]
                    if frame[1] == data:
                        if len(kinds) >= _KEPT:
                            kinds.clear()
                        kinds[around] = kind
                    data = frame[1]
                frames.append((kind[0], data, kind[1], _arrival_ns(extra, ahead_ns)))
        except BlockingIOError:
            pass
        return frames

    def _unpacked(self, got: bytes) -> tuple[int, bytes, bool] | None:
        """Return the frame in a datagram, None if there is none: anybody may send anything."""
        try:
            said = self._unpack(got)
            can_id, data, fd = said["arbitration_id"], said["data"], bool(said["is_fd"])
            last = _LAST_EXTENDED if said["is_extended_id"] else _LAST
            longest = 64 if fd else 8
            whole = isinstance(can_id, int) and isinstance(data, bytes)
            if not (whole and 0 <= can_id <= last and len(data) <= longest):
                return None
            for key, bit in _BITS:
                if said[key]:
                    can_id |= bit
        except (self._failure, ValueError, TypeError, KeyError):
            return None
        return can_id, data, fd

    def close(self) -> None:
        """Leave the group."""
        self._in.close()
        self._out.close()


def _join(port: socket.socket, family: int, address: Any) -> None:
    """Bind to a group's own address, so that frames of other groups do not come."""
    port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    port.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)  # as python-can: it shares the port
    port.bind(address)
    group = socket.inet_pton(family, address[0]) + bytes(4)  # of whatever network has a route
    if family == socket.AF_INET:
        port.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, group)
    else:
        port.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, group)


def _drop(port: socket.socket, family: int, sender: Any) -> None:
    """Have the kernel drop what one address sends: it would wake this process for nothing.

    A filter of UDP begins at its header, which has the source port; in front of it are the
    addresses (Linux Documentation/networking/filter.rst).
    """
    source = socket.inet_pton(family, sender[0])
    first = 12 if family == socket.AF_INET else 8
    words = struct.unpack(f">{len(source) // 4}I", source)
    tests = [(_LOAD_HALF, 0, sender[1])]
    tests += [(_LOAD_WORD, _NETWORK + first + 4 * at, word) for at, word in enumerate(words)]
    program = b""
    for at, (load, where, value) in enumerate(tests):
        away = 2 * (len(tests) - at - 1)
        program += _OP.pack(load, 0, 0, where & 0xFFFFFFFF) + _OP.pack(_EQUAL, 0, away + 1, value)
    program += _OP.pack(_RETURN, 0, 0, 0) + _OP.pack(_RETURN, 0, 0, 0xFFFFFFFF)
    kept = ctypes.create_string_buffer(program, len(program))
    fprog = struct.pack("@HP", len(program) // _OP.size, ctypes.addressof(kept))
    port.setsockopt(socket.SOL_SOCKET, _SO_ATTACH_FILTER, fprog)


def _arrival_ns(extra: Any, ahead_ns: int) -> int:
    """Return the monotonic time [ns] that the kernel noted, 0 without; its clock is `ahead_ns`."""
    for level, kind, data in extra:
        if (level, kind) == (socket.SOL_SOCKET, _SO_TIMESTAMPNS):
            seconds, rest = _TIMESPEC.unpack(data)
            return int(seconds * 1_000_000_000 + rest - ahead_ns)
    return 0
