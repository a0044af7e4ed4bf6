"""A bad network between any two programs: a relay of one port, TCP and UDP, seeded.

Datagrams suffer what `models.network` draws for them, each way by a generator of its own. A TCP
connection loses nothing, but each piece of it comes later by the delay, as over such a path. The
relay has no say in what passes: what is sealed stays sealed.
"""

from __future__ import annotations

import heapq
import selectors
import socket
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, Literal, NoReturn

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import Bench, BusSpec, SimulatorPlugin
from tautwave.errors import ConfigError, DriverError
from tautwave.link.trace import LARGEST, parse_trace, replayed
from tautwave.models.network import (
    EXPONENTIAL,
    LOST,
    SPIKES,
    UNIFORM,
    NetworkParams,
    network_params,
    seeded,
    transit,
)  # fmt: skip
from tautwave.reading import read_file

KINDS = {"uniform": UNIFORM, "exponential": EXPONENTIAL, "spikes": SPIKES}
PIECE = 65536
DRAWN = {
    *("delay_s", "jitter_s", "jitter", "loss", "burst", "duplicate", "reorder"),
    *("outage_at_s", "outage_s", "outage_every_s"),
}
"""Options that a trace takes the place of."""
IDLE_S = 0.2
"""The relay looks whether it shall end at least so often [s]."""


class NetworkOptions(BaseModel):
    """Options of `tautwave sim network`; shares are of datagrams."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    to: str = Field(description="HOST:PORT of the serving site.")
    listen: str = Field("127.0.0.1:7448", description="HOST:PORT that the other site connects to.")
    delay_s: float = Field(0.0, ge=0.0, le=10.0, description="[s] Minimum delay each way.")
    jitter_s: float = Field(0.0, ge=0.0, le=10.0, description="[s] Additional random delay.")
    jitter: Literal["uniform", "exponential", "spikes"] = Field(
        "uniform", description="uniform up to jitter_s, exponential about it, or spikes of it."
    )
    loss: float = Field(0.0, ge=0.0, le=0.5, description="Share that is lost.")
    burst: float = Field(
        1.0, ge=1.0, le=1000.0, description="Mean number of consecutive packets lost."
    )
    duplicate: float = Field(0.0, ge=0.0, le=1.0, description="Fraction of packets duplicated.")
    reorder: bool = Field(True, description="Whether packets may be reordered.")
    outage_at_s: float = Field(0.0, ge=0.0, description="[s] Start of the first outage.")
    outage_s: float = Field(0.0, ge=0.0, description="[s] Length of an outage.")
    outage_every_s: float = Field(
        0.0, ge=0.0, description="[s] Interval between outages; 0: a single outage."
    )
    trace: str = Field(
        "",
        description="FILE of `link test --record`: its delays and losses, both ways, are repeated "
        "in a loop instead of drawn ones.",
    )
    seed: int = Field(0, ge=0, description="Seed of the random numbers.")


class Way:
    """One way: what is drawn for each datagram, and how many were lost and repeated."""

    def __init__(
        self, params: NetworkParams, seed: int, direction: int, trace: Sequence[float] = ()
    ) -> None:
        self._params, self._trace = params, trace
        self._one, self._two = seeded(seed, direction)
        self._losing = False
        self._last_ns = 0
        self.sent = self.lost = self.repeated = 0

    def arrivals(self, now_ns: int) -> list[int]:
        """Return when a datagram sent now arrives [ns]: never, once, or twice."""
        if self._trace:
            arrival, copy = replayed(self._trace, 0, len(self._trace) // 2, now_ns), LOST
        else:
            self._one, self._two, self._losing, self._last_ns, arrival, copy = transit(
                self._params, self._one, self._two, self._losing, self._last_ns, now_ns
            )
        self.sent += 1
        self.lost += arrival == LOST
        self.repeated += copy != LOST
        return [at for at in (arrival, copy) if at != LOST]


class Relay:
    """A port that passes on what comes, later or never."""

    def __init__(self, options: NetworkOptions) -> None:
        params = network_params(
            options.delay_s, jitter=options.jitter_s, kind=KINDS[options.jitter],
            loss=options.loss, burst=options.burst, duplicates=options.duplicate,
            reorders=options.reorder, outage_at=options.outage_at_s, outage=options.outage_s,
            outage_every=options.outage_every_s,
        )  # fmt: skip
        self._delay_ns = round(options.delay_s * 1e9)
        self._to = resolved(options.to)
        trace = read_trace(options.trace) if options.trace else ()
        self.ways = Way(params, options.seed, 0, trace), Way(params, options.seed, 1, trace)
        host, port = parse(options.listen, "--listen")
        self._clients: dict[tuple[str, int], socket.socket] = {}
        self._waiting: list[tuple[int, int, Callable[[], Any]]] = []
        self._open: list[socket.socket] = []
        self._count = 0
        self._origin = time.monotonic_ns()
        self._ready = selectors.DefaultSelector()
        try:
            self._listener = socket.create_server((host, port))
            self.address: tuple[str, int] = self._listener.getsockname()[:2]
            self._datagrams = socket.socket(self._listener.family, socket.SOCK_DGRAM)
            self._datagrams.bind(self.address)
        except OSError as err:
            raise DriverError(f"sim network: {options.listen}: {err.strerror}") from err
        self._watch(self._listener, self._accept)
        self._watch(self._datagrams, self._from_client)

    def run(self, stopped: Callable[[], bool]) -> None:
        """Relay until `stopped()`."""
        while not stopped():
            now = time.monotonic_ns()
            wait = min(IDLE_S, 1e-9 * (self._waiting[0][0] - now)) if self._waiting else IDLE_S
            for key, _ in self._ready.select(max(0.0, wait)):
                key.data()
            now = time.monotonic_ns()
            while self._waiting and self._waiting[0][0] <= now:
                _, _, act = heapq.heappop(self._waiting)
                with suppress(OSError):  # who is gone gets nothing
                    act()

    def close(self) -> None:
        """Close every socket."""
        for sock in self._open:
            sock.close()
        self._ready.close()

    def _watch(self, sock: socket.socket, act: Callable[[], None]) -> None:
        sock.setblocking(False)
        self._open.append(sock)
        self._ready.register(sock, selectors.EVENT_READ, act)

    def _at(self, when_ns: int, act: Callable[[], Any]) -> None:
        self._count += 1  # keeps the order of what is due at the same time
        heapq.heappush(self._waiting, (when_ns, self._count, act))

    def _from_client(self) -> None:
        with suppress(OSError):
            while True:
                data, client = self._datagrams.recvfrom(PIECE)
                if client not in self._clients:
                    upstream = socket.socket(self._listener.family, socket.SOCK_DGRAM)
                    upstream.connect(self._to)
                    self._clients[client] = upstream
                    self._watch(upstream, partial(self._to_client, upstream, client))
                self._send(0, partial(self._clients[client].send, data))

    def _to_client(self, upstream: socket.socket, client: tuple[str, int]) -> None:
        with suppress(OSError):
            while True:
                data = upstream.recv(PIECE)
                self._send(1, partial(self._datagrams.sendto, data, client))

    def _send(self, direction: int, act: Callable[[], Any]) -> None:
        now = time.monotonic_ns() - self._origin
        for arrival in self.ways[direction].arrivals(now):
            self._at(self._origin + arrival, act)

    def _accept(self) -> None:
        connection, _ = self._listener.accept()
        try:
            upstream = socket.create_connection(self._to, timeout=5.0)
        except OSError:
            connection.close()
            return
        ends: list[socket.socket] = []
        for one, other in ((connection, upstream), (upstream, connection)):
            self._watch(one, Pipe(self, one, other, ends).pass_on)

    def forget(self, sock: socket.socket) -> None:
        """Watch a socket no longer."""
        with suppress(KeyError, ValueError):
            self._ready.unregister(sock)

    def later(self, act: Callable[[], Any]) -> None:
        """Do something after the delay."""
        self._at(time.monotonic_ns() + self._delay_ns, act)


class Pipe:
    """One way of a TCP connection."""

    def __init__(
        self, relay: Relay, here: socket.socket, there: socket.socket, ended: list[socket.socket]
    ) -> None:
        self._relay, self._here, self._there, self._ended = relay, here, there, ended
        self._left: deque[bytes] = deque()

    def pass_on(self) -> None:
        """Take what came, and give it on later; an end as well."""
        try:
            data = self._here.recv(PIECE)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._relay.forget(self._here)
        self._left.append(data)
        self._relay.later(self._give)

    def _give(self) -> None:
        data = self._left.popleft()
        if data:
            self._there.setblocking(True)
            self._there.sendall(data)
            self._there.setblocking(False)
        else:
            self._ended.append(self._here)
            with suppress(OSError):
                self._there.shutdown(socket.SHUT_WR)
            if len(self._ended) == 2:  # both ways
                for sock in self._ended:
                    sock.close()


def read_trace(path: str) -> Sequence[float]:
    """Return a trace; raises `ConfigError` where there is none."""
    try:
        return parse_trace(read_file(path, LARGEST).decode(), path)
    except (OSError, UnicodeDecodeError) as err:
        why = err.strerror if isinstance(err, OSError) else "no text"
        raise ConfigError(f"sim network: --trace {path}: {why}") from err


def parse(text: str, option: str) -> tuple[str, int]:
    """Return host and port; raises `ConfigError` where it is neither."""
    host, _, port = text.rpartition(":")
    if not host or not port.isdigit() or int(port) > 65535:
        raise ConfigError(f"sim network: {option} {text!r} is not HOST:PORT")
    return host, int(port)


def resolved(to: str) -> tuple[str, int]:
    """Return an IPv4 address to relay to, so that no datagram waits for a name.

    Raises
    ------
    ConfigError
        It is none, or its name is unknown.
    """
    host, port = parse(to, "--to")
    try:
        return str(socket.getaddrinfo(host, port, socket.AF_INET)[0][4][0]), port
    except OSError as err:
        raise ConfigError(f"sim network: --to {to}: {err.strerror or err}") from err


def serve(
    options: NetworkOptions,
    bus: BusSpec,
    physics: Sequence[Any],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    """Relay until `stopped()`, and say then what was lost."""
    relay = Relay(options)
    try:
        endpoint = "{}:{}".format(*relay.address)
        announce({"driver": "network", "endpoint": endpoint, "to": options.to})
        relay.run(stopped)
        there, back = relay.ways
        announce(
            {
                "sent": [there.sent, back.sent], "lost": [there.lost, back.lost],
                "repeated": [there.repeated, back.repeated],
            }
        )  # fmt: skip
    finally:
        relay.close()


def bench(options: NetworkOptions) -> Bench:
    """Return a relay: a bus without axes."""
    if options.loss >= options.burst / (1.0 + options.burst):
        raise ConfigError(
            f"sim network: --loss {options.loss:g} is more than bursts of {options.burst:g} can "
            "lose; raise --burst"
        )
    drawn = {name for name in options.model_fields_set if name in DRAWN}
    if options.trace and drawn:
        names = ", ".join("--" + name.replace("_", "-") for name in sorted(drawn))
        raise ConfigError(f"sim network: --trace has its own delays and losses; leave out {names}")
    return Bench(options, BusSpec("network", (), 1000.0), ())


def _no_bus(*_: Any) -> NoReturn:
    raise ConfigError("driver network is a relay between two programs, not a bus of a rig")


simulator = SimulatorPlugin(
    options=NetworkOptions,
    make=_no_bus,
    summary="a relay of one port, TCP and UDP, with the delays and losses of a bad network",
    serve=serve,
    bench_options=NetworkOptions,
    bench=bench,
)
