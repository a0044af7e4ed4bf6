"""The data plane: one UDP socket that is asked, never waited for, and what is sealed on it.

The dialling site sends first; the serving one answers to where the newest authentic datagram came
from, so a forwarded port or an address that changes on the way needs no word.
"""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator
from contextlib import suppress

from tautwave.errors import LinkError
from tautwave.sites.control import Session
from tautwave.sites.seal import Opener, Sealer

EXPEDITED = 46 << 2
"""Expedited forwarding (RFC 3246) in the byte that routers look at."""

MAX_BYTES = 2048


def open_socket(host: str, port: int) -> socket.socket:
    """Return a UDP socket at an address; raises `LinkError` where it is taken."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    sock = socket.socket(family, socket.SOCK_DGRAM)
    try:
        sock.bind((host, port))
    except OSError as err:
        sock.close()
        raise LinkError(f"UDP port {port} at {host or 'any address'}: {err.strerror}") from err
    sock.setblocking(False)
    with suppress(OSError):
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_TOS, EXPEDITED)
    return sock


class DataPort:
    """Sealed datagrams with the other site of a session."""

    def __init__(
        self,
        sock: socket.socket,
        session: Session,
        me: str,
        peer: tuple[str, int] | None,
        now_ns: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._socket = sock
        self._now_ns = now_ns
        self._peer = peer
        self._sealer = Sealer(session.secret, session.id, me)
        self.opener = Opener(session.secret, session.id, session.peer)

    def fileno(self) -> int:
        """Return the socket's, to wait for it."""
        return self._socket.fileno()

    @property
    def has_peer(self) -> bool:
        """Whether it is known where to send to."""
        return self._peer is not None

    def send(self, payload: bytes) -> None:
        """Seal and send; what the system does not take now is lost like any datagram."""
        if self._peer is not None:
            with suppress(OSError):
                self._socket.sendto(self._sealer.seal(payload), self._peer)

    def receive(self, most: int) -> Iterator[tuple[bytes, int]]:
        """Yield each authentic payload and when it was read [ns], of `most` datagrams at most."""
        for _ in range(most):
            try:
                datagram, address = self._socket.recvfrom(MAX_BYTES)
            except BlockingIOError:
                return
            except OSError:  # such as "connection refused" of an earlier send
                continue
            now = self._now_ns()
            newest = self.opener.newest
            payload = self.opener.open(datagram)
            if payload is not None:
                if self.opener.newest > newest:
                    self._peer = address  # a late one may come from where the other was before
                yield payload, now
