"""Any python-can interface, polled in the control thread: no Notifier."""

from __future__ import annotations

import logging
from collections.abc import Collection
from contextlib import suppress
from typing import Any

import can

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave.multicast import only_its_group
from tautwave_drivers.can.errors import gone
from tautwave_drivers.can.framing import ERROR_FRAME, EXTENDED, STANDARD_MASK, Echo, Framing

_POLL_NS = 200_000
"""Polling interval of a bus without a descriptor."""
_FULL_WORDS = ("buffer full", "no buffer space", "queue full", "overrun")

# Without a handler Python prints the library's warnings on stderr.
logging.getLogger("can").addHandler(logging.NullHandler())

_CLASSIC = Framing()
_ECHOING = ("udp_multicast",)
"""Interfaces that return a process its own frames."""


class PythonCanPort:
    """A python-can bus with a descriptor (socketcan, udp_multicast, ...).

    Parameters
    ----------
    bus : can.BusABC
        The open bus.
    clock : Clock
        Stamps what is received.
    where : str
        The interface, for messages.
    framing : Framing
        What it sends and takes.
    echoes : bool
        The interface returns what is sent on it.

    Attributes
    ----------
    classic_ids : set of int
        Identifiers of classic frames that came to a port of FD frames.
    """

    def __init__(
        self,
        bus: can.BusABC,
        clock: Clock,
        where: str,
        framing: Framing = _CLASSIC,
        echoes: bool = False,
    ) -> None:
        self._bus = bus
        self._where = where
        self._now_ns = clock.now_ns
        self._bus_send = bus.send
        self._bus_recv = bus.recv
        self._framing = framing
        self._fd = framing.fd
        self._ids = None if framing.ids is None else frozenset(framing.ids)
        self._echo = Echo() if echoes else None
        self.classic_ids: set[int] = set()

    def fileno(self) -> int:
        """Return the descriptor a clock waits for."""
        return self._bus.fileno()

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False when the queue is full."""
        if can_id > STANDARD_MASK or len(data) > 8:
            self._framing.check(can_id, len(data))
        message = can.Message(
            arbitration_id=can_id & ~EXTENDED,
            data=data,
            is_extended_id=bool(can_id & EXTENDED),
            is_fd=self._fd,
            bitrate_switch=self._fd,
        )
        try:
            self._bus_send(message)
        except (can.CanError, OSError, ValueError) as err:
            if _is_full(err):
                return False
            raise DriverError(f"{gone(self._where)}: {err}") from err
        if self._echo is not None:
            self._echo.sent(can_id, data, self._now_ns())
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
            data, now_ns = bytes(message.data), self._now_ns()
            if message.is_error_frame:
                return message.arbitration_id | ERROR_FRAME, data, now_ns
            can_id = message.arbitration_id | (EXTENDED if message.is_extended_id else 0)
            if not self._takes(message, can_id):
                continue
            if self._echo is not None and self._echo.is_own(can_id, data, now_ns):
                continue
            if self._fd and not message.is_fd:
                self.classic_ids.add(can_id)
            return can_id, data, now_ns

    def _takes(self, message: can.Message, can_id: int) -> bool:
        if message.is_remote_frame or (message.is_fd and not self._fd):
            return False
        if message.is_extended_id and not self._framing.extended:
            return False
        return self._ids is None or can_id in self._ids

    def listen(self, ids: Collection[int]) -> None:
        """Take these ids only from now on, and error frames."""
        self._ids = frozenset(ids)

    def purge(self) -> None:
        """Discard what waits to be sent, where the interface can."""
        with suppress(NotImplementedError, can.CanError, OSError):
            self._bus.flush_tx_buffer()

    def close(self) -> None:
        """Release the interface."""
        self._bus.shutdown()


class PolledPort(PythonCanPort):
    """A python-can bus without a descriptor (virtual): a clock comes back to look at it."""

    _ahead: tuple[int, bytes, int] | None = None
    """The frame that `readable` found."""

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame as id, data and arrival [ns], None if there is none."""
        frame, self._ahead = self._ahead, None
        return frame or super().receive()

    def readable(self) -> bool:
        """Return whether there is something to read."""
        self._ahead = self._ahead or super().receive()
        return self._ahead is not None

    def next_event_ns(self) -> int | None:
        """Return when to look again."""
        return self._now_ns() + _POLL_NS

    def advance(self, to_ns: int) -> None:
        """Do nothing: the other end runs by itself."""

    fileno = None  # type: ignore[assignment]


def _is_full(err: Exception) -> bool:
    text = str(err).lower()
    return any(words in text for words in _FULL_WORDS)


def open_python_can(options: Any, clock: Clock, framing: Framing = _CLASSIC) -> PythonCanPort:
    """Open the interface through python-can.

    Raises
    ------
    DriverError
        It cannot be opened; the message has python-can's reason.
    """
    where = f"{options.interface}:{options.channel}"
    keys: dict[str, Any] = {"bitrate": options.bitrate}
    if framing.fd:
        keys |= {"fd": True, "data_bitrate": framing.data_bitrate}
    try:
        bus = can.Bus(channel=options.channel, interface=options.interface, **keys)
    except Exception as err:  # a missing vendor's library also ends in NameError, TypeError ...
        raise DriverError(
            f"cannot open {where} through python-can ({err}); check interface and channel, and "
            "that its driver or module is installed"
        ) from err
    only_its_group(bus)
    echoes = options.interface in _ECHOING
    return port_kind(bus)(bus, clock, where, framing, echoes)


def port_kind(bus: can.BusABC) -> type[PythonCanPort]:
    """Return the kind of port for an open bus: with or without a descriptor."""
    try:
        has_descriptor = bus.fileno() >= 0
    except (NotImplementedError, can.CanError):
        has_descriptor = False
    return PythonCanPort if has_descriptor else PolledPort
