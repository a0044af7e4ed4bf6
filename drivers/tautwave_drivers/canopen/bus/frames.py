"""A raw AF_CAN socket, read without a thread, and what its error frames say.

Sources: Linux Documentation/networking/can.rst and <linux/can.h>, <linux/can/error.h>.
"""

from __future__ import annotations

import errno
import os
import socket
import struct

from tautwave.contracts import Clock
from tautwave.errors import DriverError

ERROR_FRAME = 0x20000000
"""Bit of the id of what `receive` gives for an error frame (CAN_ERR_FLAG)."""
_OTHER = 0xC0000000  # extended (EFF) and remote (RTR) frames are not used
_FRAME = struct.Struct("<IB3x8s")  # struct can_frame
_BUFFER = 16
_CAN_RAW_ERR_FILTER = 2  # <linux/can/raw.h>
_ERROR_MASK = 0x1FFFFFFF
_SO_MEMINFO, _WMEM_ALLOC = 55, 2  # <asm-generic/socket.h>, <linux/sock_diag.h>
_SEND_BUFFER = 8192
"""[bytes] A small queue on purpose: what waits in it is stale when it is sent."""

_FULL = (errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK)


def gone(where: str, err: OSError | None = None) -> DriverError:
    """Return the error for an interface that is down or gone."""
    why = "" if err is None else f" ({os.strerror(err.errno) if err.errno else err})"
    return DriverError(
        f"CAN interface {where} is down or gone{why}; check its cable and `ip link show`, then "
        f"bring it up again (ip link set {where} up type can bitrate ...)"
    )


class RawPort:
    """A raw CAN socket: a non-blocking datagram socket of `struct can_frame`.

    Parameters
    ----------
    can : socket
        Bound to its interface; a datagram socket pair does too (benches).
    clock : Clock
        Stamps what is received.
    where : str
        The interface, for messages.
    """

    def __init__(self, can: socket.socket, clock: Clock, where: str) -> None:
        can.setblocking(False)
        self._socket = can
        self._where = where
        self._now_ns = clock.now_ns
        self._send = can.send
        self._recv = can.recv
        self._pack = _FRAME.pack
        self._unpack = _FRAME.unpack_from

    @classmethod
    def open(cls, channel: str, clock: Clock) -> RawPort:
        """Open the interface `channel`, error frames on.

        Raises
        ------
        DriverError
            There is no such interface, it is down, or this kernel has no CAN.
        """
        try:
            can = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except (OSError, AttributeError) as err:
            raise DriverError(
                f"this system has no SocketCAN ({err}); load the module can-raw, or use an "
                "interface of python-can"
            ) from err
        try:
            can.setsockopt(socket.SOL_CAN_RAW, _CAN_RAW_ERR_FILTER, _ERROR_MASK)
            can.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
            can.bind((channel,))
        except OSError as err:
            can.close()
            raise gone(channel, err) from err
        return cls(can, clock, channel)

    def fileno(self) -> int:
        """Return the descriptor a clock waits for."""
        return self._socket.fileno()

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False when the queue of the interface is full."""
        try:
            self._send(self._pack(can_id, len(data), data))
        except OSError as err:
            if err.errno in _FULL:
                return False
            raise gone(self._where, err) from err
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame as id, data and arrival [ns], None if there is none."""
        can_id = _OTHER
        while can_id & _OTHER:
            try:
                got = self._recv(_BUFFER)
            except BlockingIOError:
                return None
            except OSError as err:
                raise gone(self._where, err) from err
            if len(got) != _BUFFER:
                return None
            can_id, size, data = self._unpack(got)
        return can_id, data if size >= 8 else data[:size], self._now_ns()

    def pending(self) -> int:
        """Return how many bytes this socket still has in queues on their way to the bus."""
        try:
            info = self._socket.getsockopt(socket.SOL_SOCKET, _SO_MEMINFO, 64)
        except OSError:
            return 0
        return int.from_bytes(info[4 * _WMEM_ALLOC : 4 * _WMEM_ALLOC + 4], "little")

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()


_ERRORS = (
    (0x00000001, "transmit timeout"),
    (0x00000002, "arbitration lost"),
    (0x00000008, "protocol violation"),
    (0x00000010, "transceiver error"),
    (0x00000020, "no acknowledge: no other node on the bus, or a wrong bit rate"),
    (0x00000080, "bus error"),
)
_CONTROLLER = (
    (0x01, "receive overflow: frames lost"),
    (0x02, "transmit overflow"),
    (0x04, "receive warning level"),
    (0x08, "transmit warning level"),
    (0x10, "error passive (receiving)"),
    (0x20, "error passive (transmitting)"),
    (0x40, "error active again"),
)
_BUS_OFF, _CONTROLLER_BIT, _RESTARTED = 0x40, 0x04, 0x100
_PASSIVE = 0x30


def error_text(can_id: int, data: bytes) -> tuple[str, bool]:
    """Return an error frame as text, and whether the bus is lost."""
    if can_id & _BUS_OFF:
        return (
            "bus-off: the controller has left the bus after too many errors; check wiring, "
            "termination and bit rate, then restart the interface (ip link set ... restart-ms)",
            True,
        )
    words = [text for bit, text in _ERRORS if can_id & bit]
    if can_id & _CONTROLLER_BIT:
        status = data[1] if len(data) > 1 else 0
        words += [text for bit, text in _CONTROLLER if status & bit]
        if status & _PASSIVE:
            words.append("check wiring and termination before it goes bus-off")
    if can_id & _RESTARTED:
        words.append("controller restarted")
    return "; ".join(words) or f"error frame 0x{can_id & _ERROR_MASK:08X}", False
