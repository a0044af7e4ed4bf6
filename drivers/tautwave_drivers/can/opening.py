"""The CAN interface that a rig names, through the backend it names."""

from __future__ import annotations

from typing import Any

from tautwave.contracts import Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.can.framing import Framing
from tautwave_drivers.can.multicast import MulticastPort
from tautwave_drivers.can.raw import RawPort

_CLASSIC = Framing()


def open_port(options: Any, clock: Clock, framing: Framing = _CLASSIC) -> FramePort:
    """Open the bus that the options name, by the backend they name.

    `options` have `interface`, `channel`, `bitrate` and `backend`, as `CanKeys` do.

    Raises
    ------
    DriverError
        It cannot be opened.
    """
    backend = options.backend
    if backend == "raw" and options.interface != "socketcan":
        raise DriverError(
            f"backend raw is for interface socketcan, not {options.interface}; use backend: auto"
        )
    if options.interface == "socketcan" and backend != "python-can":
        return RawPort.open(options.channel, clock, framing)
    if options.interface == "udp_multicast" and backend == "auto":
        return MulticastPort.open(options.channel, clock, framing)
    from tautwave_drivers.can.python_can import open_python_can  # an extra

    return open_python_can(options, clock, framing)
