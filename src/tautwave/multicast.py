"""Buses of python-can's `udp_multicast` kept apart: one group is one wire."""

from __future__ import annotations

import socket
from contextlib import suppress
from typing import Any

_ALL_GROUPS = {
    socket.AF_INET: (socket.IPPROTO_IP, 49),  # IP_MULTICAST_ALL, <linux/in.h>
    socket.AF_INET6: (socket.IPPROTO_IPV6, 29),  # IPV6_MULTICAST_ALL, <linux/in6.h>
}

MANY = 10_000
"""Frames that may have come since a bus was opened."""


def only_its_group(bus: Any) -> None:
    """Keep frames of other multicast groups away: Linux hands them to every socket of the port.

    Both ends of a wire have to: devices that hear a second group obey two masters.

    Parameters
    ----------
    bus : can.BusABC
        An open bus; one that is not `udp_multicast` is left as it is.
    """
    port = getattr(getattr(bus, "_multicast", None), "_socket", None)
    if not isinstance(port, socket.socket):
        return
    kind, option = _ALL_GROUPS[port.family]
    with suppress(OSError):  # not Linux: there only the groups joined arrive
        port.setsockopt(kind, option, 0)
        for _ in range(MANY):  # until now those of others came, too; ends where there is none
            port.recv(1, socket.MSG_DONTWAIT)
