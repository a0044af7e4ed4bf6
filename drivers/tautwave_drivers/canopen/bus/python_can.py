"""Any python-can interface, polled in the control thread: no Notifier."""

from __future__ import annotations

import logging
from collections import deque
from typing import Any

import can

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers.canopen.bus.frames import ERROR_FRAME, gone

_POLL_NS = 200_000
"""Polling interval of a bus without a descriptor."""
_FULL_WORDS = ("buffer full", "no buffer space", "queue full", "overrun")

# Without a handler Python prints the library's warnings on stderr.
logging.getLogger("can").addHandler(logging.NullHandler())


class PythonCanPort:
    """A python-can bus with a descriptor (socketcan, udp_multicast, ...)."""

    def __init__(self, bus: can.BusABC, clock: Clock, where: str) -> None:
        self._bus = bus
        self._where = where
        self._now_ns = clock.now_ns
        self._bus_send = bus.send
        self._bus_recv = bus.recv

    def fileno(self) -> int:
        """Return the descriptor a clock waits for."""
        return self._bus.fileno()

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False when the queue is full."""
        try:
            self._bus_send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))
        except (can.CanError, OSError, ValueError) as err:
            if _is_full(err):
                return False
            raise DriverError(f"{gone(self._where)}: {err}") from err
        return True

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame as id, data and arrival [ns], None if there is none."""
        while True:
            try:
                message = self._bus_recv(0)
            except (can.CanError, OSError, ValueError) as err:
                raise DriverError(f"{gone(self._where)}: {err}") from err
            if message is None:
                return None
            if message.is_error_frame:
                return message.arbitration_id | ERROR_FRAME, bytes(message.data), self._now_ns()
            if not (message.is_extended_id or message.is_remote_frame):
                break
        return message.arbitration_id, bytes(message.data), self._now_ns()

    def purge(self) -> None:
        """Discard what waits to be sent, where the interface can."""
        try:
            self._bus.flush_tx_buffer()
        except (NotImplementedError, can.CanError, OSError):
            return

    def close(self) -> None:
        """Release the interface."""
        self._bus.shutdown()


class PolledPort(PythonCanPort):
    """A python-can bus without a descriptor (virtual): a clock comes back to look at it."""

    def __init__(self, bus: can.BusABC, clock: Clock, where: str) -> None:
        super().__init__(bus, clock, where)
        self._ahead: deque[tuple[int, bytes, int]] = deque()

    def receive(self) -> tuple[int, bytes, int] | None:
        """As for every port."""
        if self._ahead:
            return self._ahead.popleft()
        return super().receive()

    def readable(self) -> bool:
        """Return whether there is something to read."""
        if not self._ahead:
            frame = super().receive()
            if frame is None:
                return False
            self._ahead.append(frame)
        return True

    def next_event_ns(self) -> int | None:
        """Return when to look again."""
        return self._now_ns() + _POLL_NS

    def advance(self, to_ns: int) -> None:
        """Do nothing: the other end runs by itself."""

    fileno = None  # type: ignore[assignment]


def _is_full(err: Exception) -> bool:
    text = str(err).lower()
    return any(words in text for words in _FULL_WORDS)


def open_python_can(options: Any, clock: Clock) -> PythonCanPort:
    """Open the interface through python-can.

    Raises
    ------
    DriverError
        It cannot be opened; the message has python-can's reason.
    """
    where = f"{options.interface}:{options.channel}"
    try:
        bus = can.Bus(channel=options.channel, interface=options.interface, bitrate=options.bitrate)
    except Exception as err:  # a missing vendor's library also ends in NameError, TypeError ...
        raise DriverError(
            f"cannot open {where} through python-can ({err}); check interface and channel, and "
            "that its driver or module is installed"
        ) from err
    return polled(bus, clock, where)


def polled(bus: can.BusABC, clock: Clock, where: str) -> PythonCanPort:
    """Return the port for an open bus, with or without a descriptor."""
    try:
        has_descriptor = bus.fileno() >= 0
    except (NotImplementedError, can.CanError):
        has_descriptor = False
    return (PythonCanPort if has_descriptor else PolledPort)(bus, clock, where)
