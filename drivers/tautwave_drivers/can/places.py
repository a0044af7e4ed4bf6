"""Where CAN interfaces are: those of this machine, and what can be behind one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tautwave.contracts import Endpoint

NETS = Path("/sys/class/net")
ARPHRD_CAN = "280"


def can_places() -> Sequence[Mapping[str, Any]]:
    """Return interface and channel of every CAN interface of this machine."""
    places = []
    for net in sorted(NETS.glob("*")):
        try:
            if (net / "type").read_text().strip() == ARPHRD_CAN:
                places.append({"interface": "socketcan", "channel": net.name})
        except OSError:
            continue  # it has gone meanwhile
    return places


def can_endpoint(options: Any) -> Endpoint:
    """Return what the `interface` and `channel` of some options lead to."""
    software = options.interface in ("virtual", "udp_multicast")
    if options.interface == "socketcan":
        software = options.channel.startswith(("vcan", "vxcan"))
    name = f"{options.interface}:{options.channel}"
    return Endpoint("virtual" if software else "real", name)
