"""A test of the path between two sites: agree, probe both ways, exchange what each end heard."""

from __future__ import annotations

import queue
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import MonotonicClock
from tautwave.errors import ConfigError, LinkError
from tautwave.sites.certificates import identity_files
from tautwave.sites.control import (
    AGAIN_S,
    PATIENCE_S,
    Channel,
    DroppedError,
    Meeting,
    Session,
    client_context,
    dial,
    meeting,
    server_context,
)
from tautwave.sites.datagrams import DataPort, open_socket
from tautwave.sites.probe import Heard, Way, delays_of, probe, way_of
from tautwave.sites.reception import Outcome, Reasons, Reception, serve_at

PURPOSE = {"purpose": "link test"}
"""So that a run never agrees with a test."""


class Asked(NamedTuple):
    """What the dialling site wants: datagrams each way [Hz], for how long [s]."""

    rate_hz: float
    duration_s: float


class Found(NamedTuple):
    """Both directions of a path, and the arrivals here."""

    there: Way
    back: Way
    heard: Heard

    @property
    def depth_s(self) -> float:
        """Return the play-out depth that covers 99 % of the worse direction [s]."""
        return max(self.there.depth, self.back.depth)

    @property
    def delay_s(self) -> float:
        """Return the delay of a line that plays out at that depth [s], the mean of both ways."""
        return 0.5 * (self.there.least + self.back.least) + self.depth_s

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            "there": self.there._asdict(), "back": self.back._asdict(),
            "play_out_s": self.depth_s, "delay_s": self.delay_s,
        }  # fmt: skip


def serve_tests(
    directory: Path, site: str, peer: str, address: tuple[str, int], *, once: bool = False
) -> Iterator[str]:
    """Yield a sentence on each test or refusal, indefinitely unless `once`.

    Raises
    ------
    ConfigError
        Keys are missing.
    LinkError
        The port is taken.
    """
    context = server_context(identity_files(directory, site))
    outcomes: queue.SimpleQueue[Outcome] = queue.SimpleQueue()
    testing = threading.Event()

    def meet(connection: socket.socket) -> Meeting:
        return meeting(connection, context, peer, PURPOSE, {}, busy)

    def busy() -> str:
        return f"a test with {peer} is in progress here" if testing.is_set() else ""

    def take(outcome: Outcome) -> None:
        if not isinstance(outcome, LinkError):
            testing.set()  # before anybody else is asked in
        outcomes.put(outcome)

    with serve_at(*address) as listener:
        host, port = listener.getsockname()[:2]
        yield f"{site} serves {peer} at {host}:{port}, TCP and UDP"
        reasons = Reasons()
        with Reception(listener, meet, take):
            while True:
                outcome = outcomes.get()
                if isinstance(outcome, LinkError):
                    if reasons.is_news(outcome):
                        yield str(outcome)
                    continue
                reasons = Reasons()
                try:
                    yield _serve(outcome, (host, port), site, peer)
                except LinkError as err:
                    yield str(err)
                    continue
                finally:
                    testing.clear()
                if once:
                    return


def _serve(outcome: tuple[Channel, Session], address: tuple[str, int], site: str, peer: str) -> str:
    channel, session = outcome
    try:
        asked = _asked(session.facts)
        with open_socket(*address) as sock:
            channel.send({"ready": True})
            heard = probe(DataPort(sock, session, site, None), *asked)
        way = _swap(channel, heard, asked)[0]
        return f"{peer} tested: {_line(way)}"
    finally:
        channel.close()


def run_test(address: str, directory: Path, site: str, peer: str, asked: Asked) -> Found:
    """Test the path to a site that is serving.

    Raises
    ------
    ConfigError
        Keys are missing, or the address is none.
    LinkError
        The other site is not there, refuses, or nothing comes of it.
    """
    where = parse_address(address)
    context = client_context(identity_files(directory, site))
    channel, session = _reach(where, context, peer, asked)
    try:
        if channel.receive() != {"ready": True}:
            raise LinkError(f"{peer} at {address}: is not ready")
        family = "::" if ":" in where[0] else ""
        with open_socket(family, 0) as sock:
            heard = probe(DataPort(sock, session, site, where), *asked)
        back, there = _swap(channel, heard, asked)
        return Found(there, back, heard)
    finally:
        channel.close()


def _reach(
    where: tuple[str, int], context: ssl.SSLContext, peer: str, asked: Asked
) -> tuple[Channel, Session]:
    """Dial; where many connect at once, again until the time for it is over."""
    clock = MonotonicClock()
    deadline = clock.now_ns() + round(1e9 * PATIENCE_S)
    while True:
        try:
            return dial(where, context, peer, PURPOSE, asked._asdict())
        except DroppedError:
            if clock.now_ns() > deadline:
                raise
        clock.sleep_until(clock.now_ns() + round(1e9 * AGAIN_S))


def parse_address(text: str, port: int = 7447) -> tuple[str, int]:
    """Return host and port of `HOST`, `HOST:PORT` or `[HOST]:PORT`.

    Raises
    ------
    ConfigError
        It is none of these.
    """
    host, colon, number = text.rpartition(":")
    if not colon or (host.count(":") and not host.endswith("]")):
        host, number = text, str(port)
    host = host.removeprefix("[").removesuffix("]")
    if not host or not number.isdigit() or not 0 < int(number) < 65536:
        raise ConfigError(f"{text!r} is not an address; write HOST, HOST:PORT or [HOST]:PORT")
    return host, int(number)


def _asked(facts: Any) -> Asked:
    try:
        asked = Asked(float(facts["rate_hz"]), float(facts["duration_s"]))
    except (KeyError, TypeError, ValueError) as err:
        raise LinkError("the other site did not state rate and duration in numbers") from err
    if not (1.0 <= asked.rate_hz <= 10000.0 and 1.0 <= asked.duration_s <= 3600.0):
        raise LinkError(f"the other site requested {asked.rate_hz:g} Hz, {asked.duration_s:g} s")
    return asked


def _swap(channel: Channel, heard: Heard, asked: Asked) -> tuple[Way, Way]:
    """Return the way to here and, as the other end heard it, the way from here."""
    here = way_of(heard, round(asked.rate_hz * asked.duration_s))
    channel.send({"way": here._asdict()})
    try:
        there = Way(**channel.receive(15.0)["way"])
    except (KeyError, TypeError) as err:
        raise LinkError("the other site did not report what it received") from err
    if not all(isinstance(value, int | float) for value in there):
        raise LinkError("the other site did not report what it received in numbers")
    return here, there._replace(sent=here.sent)


def table(outcome: Found, site: str, peer: str) -> Iterator[str]:
    """Yield the lines that a person reads."""
    yield f"{'':14}{f'{site} to {peer}':>20}{f'{peer} to {site}':>20}"
    rows: tuple[tuple[str, Callable[[Way], str]], ...] = (
        ("lost", lambda w: f"{w.lost / w.sent:.3%}"),
        ("most in a row", lambda w: f"{w.longest}"),
        ("reordered", lambda w: f"{w.reordered / w.sent:.3%}"),
        ("delay least", lambda w: f"{1e3 * w.least:.3f} ms"),
        ("  median", lambda w: f"{1e3 * w.median:.3f} ms"),
        ("  p99", lambda w: f"{1e3 * w.p99:.3f} ms"),
        ("  p99.9", lambda w: f"{1e3 * w.p999:.3f} ms"),
        ("  greatest", lambda w: f"{1e3 * w.greatest:.3f} ms"),
    )
    for name, text in rows:
        yield f"{name:14}{text(outcome.there):>20}{text(outcome.back):>20}"
    yield (
        f"clock: {_clock(outcome.back, peer)}; a delay of one way is known to "
        f"+-{1e3 * outcome.back.unknown:.3g} ms (half the round trips)"
    )
    yield (
        f"play-out: {1e3 * outcome.depth_s:.3g} ms covers 99 % of the worse direction, a line of "
        f"{1e3 * outcome.delay_s:.3g} ms each way; a force F leaves an offset of F tau / b"
    )


def _clock(way: Way, peer: str) -> str:
    if way.rate_unknown > 1e-3:
        return f"too short a test for the rate of {peer}'s"
    return f"{peer}'s runs {1e6 * way.rate:+.1f} +-{1e6 * way.rate_unknown:.2g} ppm"


def _line(way: Way) -> str:
    return (
        f"{way.sent} datagrams, {way.lost / way.sent:.3%} lost, p99 {1e3 * way.p99:.3g} ms on the "
        "way here"
    )


def trace(outcome: Found, rate_hz: float) -> str:
    """Return what came here as CSV: when it was sent [s], its delay [s], whether it was lost."""
    first: dict[int, float] = {}
    for one, delay in zip(outcome.heard.arrivals, delays_of(outcome.heard), strict=True):
        first.setdefault(one.number, delay)
    lines = ["time_s,delay_s,lost"]
    for number in range(outcome.back.sent):
        delay = max(0.0, first.get(number, 0.0))
        lines.append(f"{number / rate_hz:.6f},{delay:.6f},{int(number not in first)}")
    return "\n".join(lines) + "\n"
