"""The CAN interface that a rig names, through the backend it names."""

from __future__ import annotations

from typing import Any

from tautwave.contracts import Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.canopen.bus.frames import RawPort


def open_port(options: Any, clock: Clock) -> FramePort:
    """Open the bus that the options name, by the backend they name.

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
        return RawPort.open(options.channel, clock)
    from tautwave_drivers.canopen.bus.python_can import open_python_can  # an extra

    return open_python_can(options, clock)
