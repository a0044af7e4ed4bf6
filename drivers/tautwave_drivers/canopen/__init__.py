"""CANopen: CiA 402 drives as masters and slaves, by python-can, canopen, or a raw AF_CAN socket."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import CycleCost, DriverPlugin, Endpoint
from tautwave_drivers.canopen.budget import budget
from tautwave_drivers.canopen.driver import CanopenDriver
from tautwave_drivers.canopen.options import CanopenOptions, facts
from tautwave_drivers.canopen.scan import ScanOptions, scan
from tautwave_drivers.canopen.survey import survey


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.canopen.measure import measure

    return measure(cycles)


def _endpoint(options: CanopenOptions) -> Endpoint:
    software = options.interface in ("virtual", "udp_multicast")
    if options.interface == "socketcan":
        software = options.channel.startswith(("vcan", "vxcan"))
    name = f"{options.interface}:{options.channel}"
    return Endpoint("virtual" if software else "real", name)


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
    endpoint=_endpoint,
    files=(("nodes", "*", "eds"),),
    survey=survey,
)

__all__ = ["CanopenDriver", "CanopenOptions", "ScanOptions", "plugin"]
