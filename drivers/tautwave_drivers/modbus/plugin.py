"""What the entry point names; importing it needs no vendor library."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock, CycleCost, Driver, DriverPlugin
from tautwave_drivers.modbus.budget import budget
from tautwave_drivers.modbus.options import ModbusOptions, facts
from tautwave_drivers.modbus.scan import ScanOptions, scan


def _make(options: ModbusOptions, bus: BusSpec, clock: Clock, transport: Any) -> Driver:
    from tautwave_drivers.modbus.driver import ModbusDriver

    return ModbusDriver(options, bus, clock, transport)


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.modbus.measure import measure

    return measure(cycles)


plugin = DriverPlugin(
    options=ModbusOptions,
    make=_make,
    budget=budget,
    scan=scan,
    needs=("pymodbus", "serial"),
    hardware=True,
    summary="Modbus servo drives over TCP or RTU, by register maps given as data",
    facts=facts,
    scan_options=ScanOptions,
    measure=_measure,
)
