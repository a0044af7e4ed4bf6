"""CANopen: CiA 402 drives as masters and slaves, by python-can, canopen, or a raw AF_CAN socket."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import CycleCost, DriverPlugin
from tautwave_drivers.can.places import can_endpoint
from tautwave_drivers.canopen.budget import budget
from tautwave_drivers.canopen.driver import CanopenDriver
from tautwave_drivers.canopen.files.contents import contents
from tautwave_drivers.canopen.foresight import facts, foreseen
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.canopen.scan import ScanOptions, scan
from tautwave_drivers.canopen.survey import survey


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.canopen.measure import measure

    return measure(cycles)


plugin = DriverPlugin(
    options=CanopenOptions,
    make=CanopenDriver,
    budget=budget,
    scan=scan,
    needs=("can", "canopen"),
    hardware=True,
    summary="CiA 402 drives on CAN (SocketCAN, python-can)",
    facts=facts,
    scan_options=ScanOptions,
    measure=_measure,
    endpoint=can_endpoint,
    files=(("nodes", "*", "eds"),),
    survey=survey,
    foreseen=foreseen,
    contents=contents,
    columns="tautwave_drivers.canopen.driver:COLUMNS",
)

__all__ = ["CanopenDriver", "CanopenOptions", "ScanOptions", "plugin"]
