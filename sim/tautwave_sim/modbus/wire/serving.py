"""Simulated drives on real endpoints: TCP sockets, or a pseudo-terminal for RTU."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import BusSpec
from tautwave.errors import ConfigError, DriverError
from tautwave.truth import AxisModel
from tautwave_sim.modbus.bus import DriveBus
from tautwave_sim.modbus.options import SimulatedModbusOptions, host_port
from tautwave_sim.modbus.wire.tcp import Session, TcpSide
from tautwave_sim.modbus.world import make_line
from tautwave_sim.wire.pty import serve_line

Announce = Callable[[Mapping[str, Any]], None]
IDLE_NS = 50_000_000
READ = 4096
NO_PARITY = (
    "a pseudo-terminal has no parity: open it with parity N (any other is EINVAL); the bit "
    "that {} adds counts in the line's time all the same"
)
RESET = struct.pack("ii", 1, 0)
"""SO_LINGER of 0 s: closing sends a reset."""


def serve_bus(
    options: SimulatedModbusOptions,
    bus: BusSpec,
    truths: Sequence[AxisModel],
    announce: Announce,
    stopped: Callable[[], bool],
) -> None:
    """Serve the drives of a bus until `stopped()`.

    Raises
    ------
    ConfigError
        A device names an endpoint of its own, and there is one server for all; or the endpoint is
        none to listen on.
    DriverError
        The endpoint cannot be opened.
    """
    for device in options.devices:
        if device.endpoint is not None:
            raise ConfigError(
                f"{bus.name}: unit {device.unit}: simulated drives are served on one endpoint; "
                "leave the device's own out"
            )
    drives = DriveBus(options, bus, truths)
    units = sorted(drives.drives)
    about = {"driver": "modbus", "units": units, "profile": options.devices[0].profile}
    if options.link == "rtu":
        if options.parity != "N":
            about["note"] = NO_PARITY.format(options.parity)
        serve_line(
            make_line(drives, options),
            lambda path: announce(
                {**about, "endpoint": path, "baud": options.baud, "options": {"endpoint": path}}
            ),
            stopped,
        )
        return
    address = _address(options)
    report = _announcer(announce, about, address[0])
    if options.simulator.server == "pymodbus":
        from tautwave_sim.modbus.wire.vendor import serve_pymodbus

        serve_pymodbus(drives, address, report, stopped)
        return
    side = TcpSide(drives, tuple(units), wire=False)
    server = TcpServer(side, address)
    try:
        report(server.port)
        server.run(stopped)
    finally:
        server.close()


def _announcer(announce: Announce, about: Mapping[str, Any], host: str) -> Callable[[int], None]:
    reached = "127.0.0.1" if host == "0.0.0.0" else host  # that one is every address of this host

    def report(port: int) -> None:
        endpoint = f"tcp://{reached}:{port}"
        announce({**about, "endpoint": endpoint, "options": {"endpoint": endpoint}})

    return report


def _address(options: SimulatedModbusOptions) -> tuple[str, int]:
    if options.endpoint == "sim":
        return "127.0.0.1", 0
    return host_port(options.endpoint)


class TcpServer:
    """A listening socket and its connections, run by one thread with a clock.

    Parameters
    ----------
    side : TcpSide
        The drives behind it.
    address : tuple
        Host and port; port 0 picks a free one.
    """

    def __init__(self, side: TcpSide, address: tuple[str, int]) -> None:
        self._side = side
        self._clock = MonotonicClock()
        self._poll = select.epoll()
        self._links: dict[int, tuple[socket.socket, Session]] = {}
        self._listener: socket.socket | None = None
        self._host = address[0]
        try:
            self.port = self._listen(address[1])
        except OSError as err:
            self._poll.close()
            raise DriverError(
                f"modbus: cannot listen on {address[0]}:{address[1]}: {err.strerror}; choose "
                "another"
            ) from err

    def _listen(self, port: int) -> int:
        listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.setblocking(False)
            listener.bind((self._host, port))
            listener.listen()
        except OSError:
            listener.close()
            raise
        self._listener = listener
        self._poll.register(listener.fileno(), select.EPOLLIN)
        return int(listener.getsockname()[1])

    def run(self, stopped: Callable[[], bool]) -> None:
        """Serve until `stopped()`."""
        while not stopped():
            now_ns = self._clock.now_ns()
            self._side.advance(now_ns)
            self._flush()
            self._follow_plan(now_ns)
            event_ns = self._side.next_event_ns()
            deadline_ns = now_ns + IDLE_NS
            if event_ns is not None:
                deadline_ns = min(deadline_ns, event_ns)
            if self._clock.wait(self._poll, deadline_ns):
                for fd, _ in self._poll.poll(0):
                    self._serve(fd)

    def _serve(self, fd: int) -> None:
        if self._listener is not None and fd == self._listener.fileno():
            self._accept()
            return
        link = self._links.get(fd)
        if link is None:
            return
        sock, session = link
        try:
            data = sock.recv(READ)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._side.receive(session, data, self._clock.now_ns())
        else:
            self._drop(fd)

    def _accept(self) -> None:
        assert self._listener is not None
        with contextlib.suppress(OSError):
            sock, _ = self._listener.accept()
            sock.setblocking(False)
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._links[sock.fileno()] = (sock, self._side.connect())
            self._poll.register(sock.fileno(), select.EPOLLIN)

    def _flush(self) -> None:
        for fd, (sock, session) in list(self._links.items()):
            if session.broken:
                with contextlib.suppress(OSError):
                    sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
                self._drop(fd)
            elif session.out:
                try:
                    sent = sock.send(session.out)
                except BlockingIOError:
                    sent = 0  # the master does not read; the rest waits
                except OSError:
                    self._drop(fd)
                    continue
                del session.out[:sent]

    def _follow_plan(self, now_ns: int) -> None:
        """Close the listening socket while connections are refused, and open it again."""
        refuses = self._side.refuses(now_ns)
        if refuses and self._listener is not None:
            self._poll.unregister(self._listener.fileno())
            self._listener.close()
            self._listener = None
        elif not refuses and self._listener is None:
            with contextlib.suppress(OSError):  # tried again at the next turn
                self._listen(self.port)

    def _drop(self, fd: int) -> None:
        sock, session = self._links.pop(fd)
        self._side.leave(session)
        self._poll.unregister(fd)
        sock.close()

    def close(self) -> None:
        """Close all sockets."""
        for fd in list(self._links):
            self._drop(fd)
        if self._listener is not None:
            self._listener.close()
        self._poll.close()
