"""Motors in MIT mode on CAN and CAN FD: one frame commands and asks, one answers (Damiao)."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import CycleCost, DriverPlugin
from tautwave_drivers.can.places import can_endpoint
from tautwave_drivers.mit.budget import budget
from tautwave_drivers.mit.driver import MitDriver
from tautwave_drivers.mit.options import MitOptions, facts
from tautwave_drivers.mit.scan import ScanOptions, scan
from tautwave_drivers.mit.survey import survey


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.mit.measure import measure

    return measure(cycles)


plugin = DriverPlugin(
    options=MitOptions,
    make=MitDriver,
    budget=budget,
    scan=scan,
    needs=("can",),
    hardware=True,
    summary="motors in MIT mode on CAN and CAN FD (Damiao)",
    facts=facts,
    scan_options=ScanOptions,
    measure=_measure,
    endpoint=can_endpoint,
    survey=survey,
)

__all__ = ["MitDriver", "MitOptions", "ScanOptions", "plugin"]
