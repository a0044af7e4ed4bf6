"""All connections to a serving site, until their certificate is known: one thread, one deadline.

Anyone who reaches the port may connect, from the right peer's own address too. So none is turned
away on arrival: of too many whose certificate is not known yet, one makes way. First those that
have failed and only read why, then those that sent nothing for `QUIET_S`, then the rest; of these
the ones from the address with most of them; of these the oldest.
"""

from __future__ import annotations

import selectors
import socket
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress

from tautwave.clock import MonotonicClock
from tautwave.errors import LinkError
from tautwave.sites.control import PATIENCE_S, Channel, Meeting, Session, Wish

MAX_AT_ONCE = 256
"""Connections whose certificate is not known yet."""
QUIET_S = 0.5
"""One that begins TLS within this time is not the first to make way [s]."""
AT_A_TURN = 64
"""Connections taken before those that are there are attended to again."""
BACKLOG = 1024
"""Connections that the kernel keeps until they are taken; it may allow fewer."""
MAX_REASONS = 32
FULL = (
    f"over {MAX_AT_ONCE} connections at once that showed no certificate; "
    "the oldest of them are closed"
)

Outcome = tuple[Channel, Session] | LinkError


class Reasons:
    """Why handshakes failed, each reported once, at most `MAX_REASONS`: anyone may cause some."""

    def __init__(self) -> None:
        self._known: set[str] = set()

    def is_news(self, error: LinkError) -> bool:
        """Return whether to report an error: not twice, nor beyond `MAX_REASONS`."""
        why = str(error).partition(": ")[2]
        if why in self._known or len(self._known) == MAX_REASONS:
            return False
        self._known.add(why)
        return True


class _Guest:
    """One connection: its handshake, when it came [s], whether it has sent anything."""

    def __init__(self, address: str, fd: int, meeting: Meeting, now: float) -> None:
        self.address = address
        self.fd = fd
        self.meeting = meeting
        self.since = now
        self.wish = Wish()
        self.begun = False

    def rank(self, now: float, from_there: int) -> tuple[bool, bool, int, float]:
        """Return a sort key that is greatest for the connection to close first."""
        quiet = not self.begun and now - self.since > QUIET_S
        return self.wish.leaving, quiet, from_there, now - self.since


class Reception:
    """Handshakes with all that connect.

    Parameters
    ----------
    listener : socket
        Listening; it stays the caller's.
    meet : callable
        Begins the `meeting` on a connection.
    take : callable
        Called in this thread with what came of each, one at a time.
    """

    def __init__(
        self,
        listener: socket.socket,
        meet: Callable[[socket.socket], Meeting],
        take: Callable[[Outcome], None],
    ) -> None:
        listener.setblocking(False)
        self._listener = listener
        self._meet = meet
        self._take = take
        self._guests: dict[int, _Guest] = {}
        self._waiting = selectors.DefaultSelector()
        self._wake, self._woken = socket.socketpair()
        self._thread = threading.Thread(target=self._work, daemon=True)

    def __enter__(self) -> Reception:
        self._waiting.register(self._listener, selectors.EVENT_READ)
        self._waiting.register(self._woken, selectors.EVENT_READ)
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._wake.close()
        self._thread.join()
        for guest in self._guests.values():
            guest.meeting.close()
        self._waiting.close()
        self._woken.close()

    def _work(self) -> None:
        while True:
            oldest = next(iter(self._guests.values()), None)  # a dict keeps the order of arrival
            ends = None if oldest is None else oldest.since + PATIENCE_S - time.monotonic()
            ready = self._waiting.select(ends if ends is None else max(0.0, ends))
            for key, _ in ready:
                if key.fileobj is self._woken:
                    return
                if key.fileobj is not self._listener:
                    self._attend(self._guests[key.fd])
            if any(key.fileobj is self._listener for key, _ in ready):
                self._welcome()
            now = time.monotonic()
            for guest in [g for g in self._guests.values() if now - g.since >= PATIENCE_S]:
                self._resume(guest, lambda g=guest: g.meeting.throw(TimeoutError()))  # type: ignore[misc]

    def _welcome(self) -> None:
        """Take those that wait in the kernel, as long as there are any."""
        clock = MonotonicClock()
        for _ in range(AT_A_TURN):
            try:
                connection, address = self._listener.accept()
            except BlockingIOError:
                return
            except OSError as err:  # who has gone again; no more descriptors
                if not self._guests:
                    self._take(LinkError(f"a connection: cannot be accepted ({err.strerror})"))
                    clock.sleep_until(clock.now_ns() + round(1e9 * QUIET_S))
                self._make_way(len(self._guests) // 2)
                return
            fd = connection.fileno()
            guest = _Guest(address[0], fd, self._meet(connection), time.monotonic())
            self._guests[fd] = guest
            self._waiting.register(fd, selectors.EVENT_READ)
            self._resume(guest, lambda g=guest: next(g.meeting))  # type: ignore[misc]
            self._make_way(MAX_AT_ONCE)

    def _attend(self, guest: _Guest) -> None:
        guest.begun = True
        self._resume(guest, lambda: next(guest.meeting))

    def _resume(self, guest: _Guest, step: Callable[[], Wish]) -> None:
        """Continue a handshake, until it waits again or has a result."""
        try:
            wish = step()
        except StopIteration as found:
            self._forget(guest)
            self._take(found.value)
        except LinkError as err:
            self._forget(guest)
            self._take(err)
        except OSError as err:
            self._forget(guest)
            self._take(LinkError(f"{guest.address}: connection lost ({err.strerror or err})"))
        else:
            if wish.writing != guest.wish.writing:
                event = selectors.EVENT_WRITE if wish.writing else selectors.EVENT_READ
                self._waiting.modify(guest.fd, event)
            guest.wish = wish

    def _make_way(self, most: int) -> None:
        """Close connections until no more than `most` are left."""
        while len(self._guests) > most:
            now = time.monotonic()
            crowd = Counter(guest.address for guest in self._guests.values())
            guests = self._guests.values()
            last = max(guests, key=lambda guest: guest.rank(now, crowd[guest.address]))
            self._forget(last)
            last.meeting.close()
            self._take(LinkError(f"{last.address}: {FULL}"))

    def _forget(self, guest: _Guest) -> None:
        del self._guests[guest.fd]
        with suppress(KeyError, ValueError, OSError):  # closed already: the kernel has forgotten it
            self._waiting.unregister(guest.fd)


def serve_at(host: str, port: int) -> socket.socket:
    """Return a listening socket; raises `LinkError` where the port is taken."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        return socket.create_server((host, port), family=family, backlog=BACKLOG)
    except OSError as err:
        raise LinkError(f"TCP port {port} at {host or 'any address'}: {err.strerror}") from err
