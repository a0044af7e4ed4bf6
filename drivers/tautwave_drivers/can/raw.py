"""A raw AF_CAN socket, read without a thread.

Source: Linux Documentation/networking/can.rst, <linux/can.h>, <linux/can/raw.h>.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
from collections.abc import Collection, Sequence
from pathlib import Path

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers.can.batches import send_each
from tautwave_drivers.can.errors import gone
from tautwave_drivers.can.framing import (
    EXTENDED,
    EXTENDED_MASK,
    STANDARD_MASK,
    Framing,
)

_REMOTE = 0x40000000
_FRAME = struct.Struct("<IB3x8s")  # struct can_frame
_PACK, _UNPACK, _MTU = _FRAME.pack, _FRAME.unpack, _FRAME.size
_FD_FRAME = struct.Struct("<IBB2x64s")  # struct canfd_frame
_RATE_SWITCH = 0x01  # CANFD_BRS
_FD_MTU = 72
_RAW_FILTER, _RAW_ERR_FILTER, _RAW_FD_FRAMES = 1, 2, 5  # <linux/can/raw.h>
_ERROR_MASK = 0x1FFFFFFF
_SO_MEMINFO, _WMEM_ALLOC = 55, 2  # <asm-generic/socket.h>, <linux/sock_diag.h>
_SEND_BUFFER = 8192
"""[bytes] A small queue on purpose: what waits in it is stale when it is sent."""

_FULL = (errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK)
_CLASSIC = Framing()
NETS = Path("/sys/class/net")


class RawPort:
    """A raw CAN socket: a non-blocking datagram socket of `struct can_frame` and `canfd_frame`.

    Parameters
    ----------
    can : socket
        Bound to its interface; a datagram socket pair does too (benches).
    clock : Clock
        Stamps what is received.
    where : str
        The interface, for messages.
    framing : Framing
        What it sends and takes; a kernel's socket filters by `ids` itself.

    Attributes
    ----------
    classic_ids : set of int
        Identifiers of classic frames that came to a port of FD frames.
    """

    def __init__(
        self, can: socket.socket, clock: Clock, where: str, framing: Framing = _CLASSIC
    ) -> None:
        can.setblocking(False)
        self._socket = can
        self._where = where
        self._now_ns = clock.now_ns
        self._send = can.send
        self._recv = can.recv
        self._queue: select.epoll | None = None
        self._framing = framing
        self._fd = framing.fd
        self._others = _REMOTE if framing.extended else _REMOTE | EXTENDED
        self.classic_ids: set[int] = set()

    @classmethod
    def open(cls, channel: str, clock: Clock, framing: Framing = _CLASSIC) -> RawPort:
        """Open the interface `channel`, error frames on.

        Raises
        ------
        DriverError
            There is no such interface, it is down, has no FD where that is wanted, or this kernel
            has no CAN.
        """
        try:
            can = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except (OSError, AttributeError) as err:
            raise DriverError(
                f"this system has no SocketCAN ({err}); load the module can-raw, or use an "
                "interface of python-can"
            ) from err
        try:
            can.setsockopt(socket.SOL_CAN_RAW, _RAW_ERR_FILTER, _ERROR_MASK)
            if framing.ids is not None:
                can.setsockopt(socket.SOL_CAN_RAW, _RAW_FILTER, filters(framing))
            if framing.fd:
                can.setsockopt(socket.SOL_CAN_RAW, _RAW_FD_FRAMES, 1)
            can.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            can.bind((channel,))
        except OSError as err:
            can.close()
            raise gone(channel, err) from err
        if framing.fd and _mtu(channel) < _FD_MTU:
            can.close()
            raise DriverError(
                f"CAN interface {channel} is set up without FD; set it to both rates (ip link set "
                f"{channel} up type can bitrate ... dbitrate {framing.data_bitrate} fd on), or "
                "remove data_bitrate"
            )
        return cls(can, clock, channel, framing)

    def fileno(self) -> int:
        """Return the descriptor a clock waits for."""
        return self._socket.fileno()

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False when the queue of the interface is full."""
        size = len(data)
        if can_id > STANDARD_MASK or size > 8:
            self._framing.check(can_id, size)
        try:
            if self._fd:
                self._send(_FD_FRAME.pack(can_id, size, _RATE_SWITCH, data))
            else:
                self._send(_FRAME.pack(can_id, size, data))
        except OSError as err:
            if err.errno in _FULL:
                return False
            raise gone(self._where, err) from err
        return True

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Send frames until the queue of the interface is full; return how many went out."""
        if self._fd:
            return send_each(self, frames)
        send, pack = self._send, _PACK
        sent = 0
        try:
            for can_id, data in frames:
                size = len(data)
                if can_id > STANDARD_MASK or size > 8:
                    self._framing.check(can_id, size)
                send(pack(can_id, size, data))
                sent += 1
        except OSError as err:
            if err.errno not in _FULL:
                raise gone(self._where, err) from err
        return sent

    def has_frames(self) -> bool:
        """Return whether there is something to take, quicker than by taking nothing."""
        if self._queue is None:
            self._queue = select.epoll()
            self._queue.register(self._socket, select.EPOLLIN)
        return bool(self._queue.poll(0))

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame as id, data and arrival [ns], None if there is none."""
        frames = self.receive_some(1)
        return frames[0] if frames else None

    def receive_some(self, most: int) -> list[tuple[int, bytes, int]]:
        """Return what has arrived, oldest first, `most` frames at most."""
        recv, now_ns, others, fd = self._recv, self._now_ns, self._others, self._fd
        frames: list[tuple[int, bytes, int]] = []
        try:
            while len(frames) < most:
                got = recv(_FD_MTU)
                if len(got) == _MTU:
                    can_id, size, data = _UNPACK(got)
                    if fd:
                        self.classic_ids.add(can_id)
                    if size < 8:
                        data = data[:size]
                elif len(got) == _FD_MTU and fd:
                    can_id, size, _, data = _FD_FRAME.unpack(got)
                    if size < 64:
                        data = data[:size]
                else:
                    continue
                if not can_id & others:
                    frames.append((can_id, data, now_ns()))
        except BlockingIOError:
            pass
        except OSError as err:
            if not frames:  # else the next call says it
                raise gone(self._where, err) from err
        return frames

    def listen(self, ids: Collection[int]) -> None:
        """Take these ids only from now on, and error frames."""
        self._framing = self._framing._replace(ids=ids)
        if self._socket.family == getattr(socket, "AF_CAN", None):
            self._socket.setsockopt(socket.SOL_CAN_RAW, _RAW_FILTER, filters(self._framing))

    def pending(self) -> int:
        """Return how many bytes this socket still has in queues on their way to the bus."""
        try:
            info = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 64)
        except OSError:
            return 0
        return int.from_bytes(info[4 * _WMEM_ALLOC : 4 * _WMEM_ALLOC + 4], "little")

    def close(self) -> None:
        """Close the socket."""
        if self._queue is not None:
            self._queue.close()
        self._socket.close()


def filters(framing: Framing) -> bytes:
    """Return the `struct can_filter`s that let the ids of a framing pass, and nothing else."""
    exact = EXTENDED | _REMOTE
    return b"".join(
        struct.pack("<II", one, exact | (EXTENDED_MASK if one & EXTENDED else STANDARD_MASK))
        for one in framing.ids or ()
    )


def _mtu(channel: str) -> int:
    try:
        return int((NETS / channel / "mtu").read_text())
    except (OSError, ValueError):
        return _FD_MTU  # not known: sending will tell
