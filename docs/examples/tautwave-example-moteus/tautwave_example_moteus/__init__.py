"""moteus controllers on CAN FD: a driver that is no part of tautwave, on its CAN room."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.plugin import AxisSpec, BusSpec, DriverError, DriverPlugin, MonotonicClock
from tautwave_drivers.can.places import can_endpoint
from tautwave_example_moteus.driver import REPORTED, MoteusDriver
from tautwave_example_moteus.options import Options, budget


class ScanOptions(Options):
    """Options of `tautwave scan moteus`."""

    devices: tuple = ()  # type: ignore[assignment,type-arg]
    first: int = 1
    last: int = 16


def scan(options: ScanOptions, progress: Any) -> Sequence[Mapping[str, Any]]:
    """Stop each id in turn, which is harmless, and list who says who it is."""
    found = []
    for number in range(options.first, options.last + 1):
        progress((number - options.first) / (options.last - options.first + 1), f"id {number}")
        keys = options.model_dump(exclude={"devices", "first", "last"})
        axis = AxisSpec("scan.device", number, "rotary", "impedance", effort_limit=1.0)
        bus = BusSpec("scan", (axis,), 1000.0)
        one = MoteusDriver(Options(**keys, devices=({"id": number},)), bus, MonotonicClock(), None)
        try:
            one.open()
        except DriverError:
            continue
        found.append({"id": number, **one.identities["scan.device"]})
        one.close()
    return found


plugin = DriverPlugin(
    options=Options,
    make=MoteusDriver,
    budget=budget,
    scan=scan,
    needs=("can",),
    hardware=True,
    summary="moteus controllers on CAN FD (example)",
    scan_options=ScanOptions,
    endpoint=can_endpoint,
    columns=REPORTED,
)
