"""CANopen: CiA 402 drives as masters and slaves, by python-can, canopen, or a raw AF_CAN socket."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock, CycleCost, Driver, DriverPlugin
from tautwave_drivers.canopen.budget import budget
from tautwave_drivers.canopen.driver import CanopenDriver
from tautwave_drivers.canopen.options import CanopenOptions, facts
from tautwave_drivers.canopen.scan import ScanOptions, scan


def _make(options: CanopenOptions, bus: BusSpec, clock: Clock, transport: Any) -> Driver:
    return CanopenDriver(options, bus, clock, transport)


def _scan(options: ScanOptions) -> Sequence[Mapping[str, Any]]:
    return scan(options)


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.canopen.measure import measure

    return measure(cycles)


plugin = DriverPlugin(
    options=CanopenOptions,
    make=_make,
    budget=budget,
    scan=_scan,
    needs=("can", "canopen"),
    hardware=True,
    summary="CiA 402 drives on CAN (SocketCAN, python-can)",
    facts=facts,
    scan_options=ScanOptions,
    measure=_measure,
)

__all__ = ["CanopenDriver", "CanopenOptions", "ScanOptions", "plugin"]
