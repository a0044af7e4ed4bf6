"""Motors whose frame commands and asks, on CAN and CAN FD: Damiao in MIT mode, and RobStride."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock, CycleCost, Driver, DriverPlugin
from tautwave_drivers.can.places import can_endpoint
from tautwave_drivers.mit.budget import budget
from tautwave_drivers.mit.driver import MitDriver
from tautwave_drivers.mit.options import MitOptions, facts
from tautwave_drivers.mit.robstride_driver import RobstrideDriver
from tautwave_drivers.mit.scan import ScanOptions, scan
from tautwave_drivers.mit.survey import survey


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.mit.measure import measure

    return measure(cycles)


def make(options: MitOptions, bus: BusSpec, clock: Clock, transport: Any) -> Driver:
    """Return the driver of the family that the options name."""
    if options.family == "robstride":
        return RobstrideDriver(options, bus, clock, transport)
    return MitDriver(options, bus, clock, transport)


plugin = DriverPlugin(
    options=MitOptions,
    make=make,
    budget=budget,
    scan=scan,
    needs=("can",),
    hardware=True,
    summary="motors in MIT mode on CAN and CAN FD (Damiao), RobStride",
    facts=facts,
    scan_options=ScanOptions,
    measure=_measure,
    endpoint=can_endpoint,
    survey=survey,
    columns="tautwave_drivers.mit.columns:COLUMNS",
)

__all__ = ["MitDriver", "MitOptions", "RobstrideDriver", "ScanOptions", "make", "plugin"]
