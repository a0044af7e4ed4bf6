"""Dynamixel servos on a serial line: X series over protocol 2.0; AX and MX are found by `scan`.

    options.py    the `options` block of a bus, and what a rig's axes need of it
    protocol/     packets of protocol 2.0 and 1.0, control tables, models, units; no I/O
    line/         one transaction at a time: ping, read, write, reboot; the adapter's latency timer
    bringup.py    checks and settings before torque
    exchange.py   one sync write and one sync read a cycle; fast_path.py for complete responses
    driver.py     the driver the loop sees; enabling.py and watching.py parts of it
    budget.py     bus time; scan.py finding servos; measure.py the host's cost

Only `line/sdk.py` imports the vendor library, and only for `transport: sdk`.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import AxisFacts, BusSpec, CycleCost, DriverPlugin, Endpoint
from tautwave_drivers.dynamixel.budget import budget
from tautwave_drivers.dynamixel.driver import DynamixelDriver
from tautwave_drivers.dynamixel.options import DynamixelOptions, match_servos
from tautwave_drivers.dynamixel.protocol.indirect import check_one_family
from tautwave_drivers.dynamixel.protocol.units import scale_of
from tautwave_drivers.dynamixel.scan import ScanOptions, scan
from tautwave_drivers.dynamixel.survey import survey


def _facts(options: DynamixelOptions, bus: BusSpec) -> Sequence[AxisFacts]:
    servos = match_servos(options, bus)
    if options.status_block:
        check_one_family(servos)
    facts = []
    for servo in servos:
        scale = scale_of(servo)
        velocity = 0.0 if servo.impedance else scale.velocity
        facts.append(
            AxisFacts(scale.position)
            if servo.axis.takes_position
            else AxisFacts(scale.position, scale.effort, velocity)
        )
    return facts


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.dynamixel.measure import measure

    return measure(cycles)


def _endpoint(options: DynamixelOptions) -> Endpoint:
    return Endpoint("none") if options.port == "sim" else Endpoint("real", options.port)


plugin = DriverPlugin(
    options=DynamixelOptions,
    make=DynamixelDriver,
    budget=budget,
    scan=scan,
    # Speaks for itself; dynamixel-sdk only where `transport: sdk` asks for it.
    needs=(),
    hardware=True,
    summary="Dynamixel X servos (protocol 2.0) on a serial line",
    facts=_facts,
    scan_options=ScanOptions,
    measure=_measure,
    endpoint=_endpoint,
    survey=survey,
    positions=True,
    columns="tautwave_drivers.dynamixel.driver:COLUMNS",
)
