"""The order that an end of `tautwave bench link` is given."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import NamedTuple

HOST = "127.0.0.1"


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
    """Return a UDP port that is free just now."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind((HOST, 0))
        return int(sock.getsockname()[1])
