"""The order that an end of `tautwave bench link` is given."""

from __future__ import annotations

import random
import socket
from collections.abc import Sequence
from typing import NamedTuple

from tautwave.errors import LinkError

HOST = "127.0.0.1"
QUIET, NETWORK, HOSTILE = range(3)
"""Turns: without network, with it, and with a stranger's datagrams as well."""
TURN_NS = 200_000_000
"""Length of a turn, at all processes at the same time: short beside what else a machine does."""


class Order(NamedTuple):
    """What an end has to know: ports of its own and the other's two sockets, and for how long."""

    side: int
    own: Sequence[int]
    other: Sequence[int]
    session: str
    secret: str
    rate_hz: float
    duration_s: float


def free_port() -> int:
    """Return a port that is free just now, TCP and UDP, and that no system gives out by itself."""
    for port in random.SystemRandom().sample(range(10_000, 30_000), 100):
        try:
            for kind in (socket.SOCK_DGRAM, socket.SOCK_STREAM):
                with socket.socket(socket.AF_INET, kind) as sock:
                    sock.bind((HOST, port))
        except OSError:
            continue
        return port
    raise LinkError(f"no free port at {HOST} between 10000 and 30000")


def turn_of(now_ns: int) -> int:
    """Return whose turn it is at a moment of the machine's clock [ns]."""
    return now_ns // TURN_NS % 3
