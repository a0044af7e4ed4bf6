"""Bare ends of a CAN bus for stand-ins of devices, to measure the host's cost of an exchange."""

from __future__ import annotations

import socket
import struct
from typing import Protocol

import can

_FRAME = struct.Struct("<IB3x8s")


class End(Protocol):
    """A bare end of a transport."""

    def put(self, can_id: int, data: bytes) -> None: ...  # noqa: D102

    def take(self) -> tuple[int, bytes] | None: ...  # noqa: D102

    def close(self) -> None: ...  # noqa: D102


class SocketEnd:
    """A non-blocking datagram socket with the frames of SocketCAN."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end

    def put(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        self._end.send(_FRAME.pack(can_id, len(data), data))

    def take(self) -> tuple[int, bytes] | None:
        """Receive a frame, if there is one."""
        try:
            can_id, size, data = _FRAME.unpack(self._end.recv(_FRAME.size))
        except BlockingIOError:
            return None
        return can_id, data[:size]

    def close(self) -> None:
        """Close the socket."""
        self._end.close()


class BusEnd:
    """A python-can bus."""

    def __init__(self, channel: str) -> None:
        self.bus = can.Bus(interface="virtual", channel=channel)

    def put(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def take(self) -> tuple[int, bytes] | None:
        """Receive a frame, if there is one."""
        message = self.bus.recv(0)
        return None if message is None else (message.arbitration_id, bytes(message.data))

    def close(self) -> None:
        """Leave the bus."""
        self.bus.shutdown()
