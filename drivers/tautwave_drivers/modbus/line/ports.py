"""TCP connections that never block, and several ports as one transport to wait on."""

from __future__ import annotations

import errno
import os
import select
import socket
from collections.abc import Sequence
from functools import cache
from typing import Any

from tautwave.contracts import BytePort
from tautwave.errors import DriverError
from tautwave_drivers.modbus.options import host_port

CHUNK = 4096
_WORDS = {
    errno.ECONNREFUSED: "connection refused; check that the drive is on, and the port",
    errno.ECONNRESET: "reset by the drive; it was switched off, or serves another master",
    errno.EPIPE: "closed by the drive; it was switched off, or serves another master",
    errno.EHOSTUNREACH: "no route to this host; check cable and addresses",
    errno.ENETUNREACH: "no route to this network; check cable and addresses",
    errno.ETIMEDOUT: "no response; check cable, supply and address",
}


@cache
def _resolve(endpoint: str) -> tuple[int, int, int, Any]:
    """Return family, kind, protocol and address; resolved once, since a name server may be slow."""
    host, port = host_port(endpoint)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM
        )[0]
    except OSError as err:
        raise DriverError(f"{endpoint}: {err.strerror}; correct endpoint") from err
    return family, kind, protocol, address


class TcpPort:
    """A TCP connection, from connecting to closed.

    Parameters
    ----------
    endpoint : str
        tcp://HOST:PORT.

    Raises
    ------
    DriverError
        The host is not known, or refuses at once.
    """

    def __init__(self, endpoint: str) -> None:
        self._name = endpoint
        family, kind, protocol, address = _resolve(endpoint)
        self._socket = socket.socket(family, kind, protocol)
        self._socket.setblocking(False)
        # An exchange is one small packet each way: waiting for more would cost 40 ms.
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._there = False
        code = self._socket.connect_ex(address)
        if code not in (0, errno.EINPROGRESS):
            self._socket.close()
            raise DriverError(self._text(code))

    def connected(self) -> bool:
        """Return whether the connection is there; raises `DriverError` when it is refused."""
        if not self._there:
            _, ready, _ = select.select((), (self._socket,), (), 0.0)
            if ready:
                code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
                if code:
                    raise DriverError(self._text(code))
                self._there = True
        return self._there

    def fileno(self) -> int:
        """Return the file descriptor, for `Clock.wait`."""
        return self._socket.fileno()

    def write(self, data: bytes) -> None:
        """Send; raises `DriverError` when the other end is gone or takes nothing any more."""
        try:
            sent = self._socket.send(data)
        except BlockingIOError:
            sent = 0
        except OSError as err:
            raise DriverError(self._text(err.errno)) from err
        if sent < len(data):
            raise DriverError(
                f"{self._name}: accepts no more bytes; it hangs, or its cable is unplugged"
            )

    def read(self) -> bytes:
        """Return all that has come, at once; raises `DriverError` when the other end is gone."""
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError as err:
            raise DriverError(self._text(err.errno)) from err
        if not data:
            raise DriverError(self._text(errno.EPIPE))
        return data

    def close(self) -> None:
        """Release the connection; idempotent."""
        self._socket.close()

    def _text(self, code: int | None) -> str:
        return f"{self._name}: {_WORDS.get(code or 0, os.strerror(code or 0))}"


class PortGroup:
    """Several ports as one transport for `Clock.wait`: readable as soon as one is."""

    def __init__(self, ports: Sequence[Any]) -> None:
        self._ports = list(ports)

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself [ns]."""
        events = [port.next_event_ns() for port in self._ports]
        return min((event for event in events if event is not None), default=None)

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        for port in self._ports:
            port.advance(to_ns)

    def readable(self) -> bool:
        """Return whether there is something to read."""
        return any(port.readable() for port in self._ports)


class EpollGroup:
    """The same for ports of the kernel: an epoll set, which is itself readable."""

    def __init__(self, ports: Sequence[BytePort]) -> None:
        self._set = select.epoll()
        for port in ports:
            self._set.register(port.fileno(), select.EPOLLIN)  # type: ignore[attr-defined]

    def fileno(self) -> int:
        """Return the file descriptor, for `Clock.wait`."""
        return self._set.fileno()

    def close(self) -> None:
        """Release it; idempotent."""
        self._set.close()
