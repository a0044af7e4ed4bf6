"""What the entry point names; importing it needs no vendor library."""

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
)
