"""Modbus drives over TCP and RTU: a map of registers given as data, at the rate the line carries.

    options.py    the `options` block of a bus, and what a rig's axes need of it
    profile.py    families of drives as data; profiles/ those that are shipped
    protocol/     requests and responses as bytes, register types, exception texts; no I/O
    line/         links (TCP, RTU), ports, and the client that waits for a response
    sequence.py   enabling and disabling step by step; machine402.py by CiA 402
    station.py    one drive in the cycle: what is requested of it, what its responses mean
    bringup.py    checks and settings before enabling; enabling.py from off to on, step by step
    driver.py     the driver the loop sees
    budget.py     bus time; scan.py finding drives; measure.py the host's cost

Only `protocol/frames.py` imports pymodbus, with the first frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock, CycleCost, Driver, DriverPlugin, Endpoint
from tautwave_drivers.modbus.budget import budget
from tautwave_drivers.modbus.options import ModbusOptions, facts
from tautwave_drivers.modbus.scan import ScanOptions, scan
from tautwave_drivers.modbus.survey import survey


def _make(options: ModbusOptions, bus: BusSpec, clock: Clock, transport: Any) -> Driver:
    from tautwave_drivers.modbus.driver import ModbusDriver

    return ModbusDriver(options, bus, clock, transport)


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.modbus.measure import measure

    return measure(cycles)


def _foreseen(options: ModbusOptions, bus: BusSpec) -> Sequence[str]:
    from tautwave_drivers.modbus.reading_back import unseen_dips

    return unseen_dips(options, bus)


def _endpoint(options: ModbusOptions) -> Endpoint:
    used = dict.fromkeys(device.endpoint or options.endpoint for device in options.devices)
    named = [one for one in used if one != "sim"]
    return Endpoint("real", ", ".join(named)) if named else Endpoint("none")


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
    endpoint=_endpoint,
    files=(("devices", "*", "profile"),),
    survey=survey,
    foreseen=_foreseen,
    columns="tautwave_drivers.modbus.driver:COLUMNS",
)
