"""What bytes go through: TCP connections and serial devices, never blocking."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import select
import socket
from collections.abc import Sequence
from functools import cache
from typing import Any

from tautwave.contracts import BytePort
from tautwave.errors import DriverError
from tautwave_drivers.modbus.options import ModbusOptions, host_port

CHUNK = 4096
FRAME = 256
"""The longest on a serial line."""
_NOTHING = bytes(4)
_GONE = {errno.EIO, errno.ENODEV, errno.ENXIO, errno.EBADF}
_WORDS = {
    errno.ECONNREFUSED: "refused: nothing listens there; is the drive on, and the port right?",
    errno.ECONNRESET: "reset by the drive; it was switched off, or serves another master",
    errno.EPIPE: "closed by the drive; it was switched off, or serves another master",
    errno.EHOSTUNREACH: "there is no way to this host; check cable and addresses",
    errno.ENETUNREACH: "there is no way to this network; check cable and addresses",
    errno.ETIMEDOUT: "nothing answers there; check cable, supply and address",
}


@cache
def _resolve(endpoint: str) -> tuple[int, int, int, Any]:
    """Return family, kind, protocol and address; asked once, since a name server may take long."""
    host, port = host_port(endpoint)
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host, port, type=socket.SOCK_STREAM
        )[0]
    except OSError as err:
        raise DriverError(f"{endpoint}: {err.strerror}; correct endpoint") from err
    return family, kind, protocol, address


class TcpPort:
    """A connection that is being made, then one that is there.

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
            raise DriverError(self._words(code))

    def connected(self) -> bool:
        """Return whether the connection is there; raises `DriverError` when it is refused."""
        if not self._there:
            _, ready, _ = select.select((), (self._socket,), (), 0.0)
            if ready:
                code = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
                if code:
                    raise DriverError(self._words(code))
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
            raise DriverError(self._words(err.errno)) from err
        if sent < len(data):
            raise DriverError(f"{self._name}: takes no more bytes; it hangs, or its cable is out")

    def read(self) -> bytes:
        """Return all that has come, at once; raises `DriverError` when the other end is gone."""
        try:
            data = self._socket.recv(CHUNK)
        except BlockingIOError:
            return b""
        except OSError as err:
            raise DriverError(self._words(err.errno)) from err
        if not data:
            raise DriverError(self._words(errno.EPIPE))
        return data

    def close(self) -> None:
        """Release the connection; idempotent."""
        self._socket.close()

    def _words(self, code: int | None) -> str:
        return f"{self._name}: {_WORDS.get(code or 0, os.strerror(code or 0))}"


class SerialPort:
    """A serial device: raw, exclusive, at the line's baud rate and parity; opened by pyserial.

    Parameters
    ----------
    path : str
        The device.
    options : ModbusOptions
        Baud rate, parity, stop bits.

    Raises
    ------
    DriverError
        It cannot be opened.
    """

    def __init__(self, path: str, options: ModbusOptions) -> None:
        import termios

        import serial  # type: ignore[import-untyped]

        self._name = path
        try:
            self._device: Any = serial.Serial(
                path,
                options.baud,
                parity=options.parity,
                stopbits=options.stop_bits,
                timeout=0,
                exclusive=True,
            )
        except (OSError, ValueError) as err:  # SerialException is an OSError
            raise DriverError(_not_open(path, err)) from err
        self._fd: int = self._device.fileno()
        os.set_blocking(self._fd, False)
        self._fionread = termios.FIONREAD
        self._count = bytearray(4)
        keys = termios.tcgetattr(self._fd)
        # A read without data has to say so (EAGAIN), and not look like a closed line.
        keys[6][termios.VMIN], keys[6][termios.VTIME] = 1, 0
        termios.tcsetattr(self._fd, termios.TCSANOW, keys)

    def fileno(self) -> int:
        """Return the file descriptor, for `Clock.wait`."""
        return self._fd

    def write(self, data: bytes) -> None:
        """Hand bytes to the line; what its buffer has no room for is dropped."""
        try:
            os.write(self._fd, data)
        except BlockingIOError:
            pass
        except OSError as err:
            raise DriverError(self._lost(err)) from err

    def read(self) -> bytes:
        """Return all that has come, at once."""
        try:
            data = os.read(self._fd, FRAME)
        except BlockingIOError:
            return b""
        except OSError as err:
            raise DriverError(self._lost(err)) from err
        if not data:
            raise DriverError(
                f"{self._name}: unplugged, or its other end closed; plug it in and run again"
            )
        return data

    def waiting(self) -> bool:
        """Return whether `read` has something to say; a third of what asking it costs."""
        try:
            fcntl.ioctl(self._fd, self._fionread, self._count)
        except OSError:
            return True
        return self._count != _NOTHING

    def close(self) -> None:
        """Release the device; idempotent."""
        self._fd = -1
        with contextlib.suppress(OSError):
            self._device.close()

    def _lost(self, err: OSError) -> str:
        if err.errno in _GONE:
            return f"{self._name}: the adapter is gone ({err.strerror}); plug it in and run again"
        return f"{self._name}: {err.strerror}"


def _not_open(path: str, err: Exception) -> str:
    code = getattr(err, "errno", None)
    if code == errno.ENOENT:
        return f"{path}: there is no such device; plug the adapter in, or correct the endpoint"
    if code == errno.EACCES:
        return f"{path}: not permitted; add yourself to its group: sudo usermod -aG dialout $USER"
    if code in (errno.EBUSY, errno.EAGAIN):
        return (
            f"{path}: another program has it open, or another bus of this rig; close that, or list "
            "all devices of a line on one bus"
        )
    return f"{path}: cannot be opened: {err}"


class Together:
    """Several ports as one transport for `Clock.wait`: readable as soon as one is."""

    def __init__(self, ports: Sequence[Any]) -> None:
        self._ports = list(ports)

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself [ns]."""
        events = [port.next_event_ns() for port in self._ports]
        return min((event for event in events if event is not None), default=None)

    def advance(self, to_ns: int) -> None:
        """Let everything happen that happens up to `to_ns`."""
        for port in self._ports:
            port.advance(to_ns)

    def readable(self) -> bool:
        """Return whether there is something to read."""
        return any(port.readable() for port in self._ports)


class Watched:
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
