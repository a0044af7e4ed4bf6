"""Feetech servos (STS, SMS, HLS) on a serial line: efforts by current or by voltage, positions.

options.py    the `options` block of a bus, and what a rig's axes need of it
tables.py     registers of the series, which firmware has which; models.py what is known of them
line.py       one transaction at a time; exchange.py one sync write and one sync read a cycle
bringup.py    checks and settings before torque; enabling.py, leaving.py torque on and off
driver.py     the driver the loop sees; keeper.py a process that stops all if the run is killed
budget.py     bus time; scan.py finding servos, survey.py their part of a rig; measure.py cost
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import CycleCost, DriverPlugin, Endpoint
from tautwave_drivers.feetech.budget import budget
from tautwave_drivers.feetech.driver import FeetechDriver
from tautwave_drivers.feetech.options import FeetechOptions, facts, foreseen
from tautwave_drivers.feetech.scan import ScanOptions, scan
from tautwave_drivers.feetech.survey import survey


def _measure(cycles: int) -> Sequence[CycleCost]:
    from tautwave_drivers.feetech.measure import measure

    return measure(cycles)


def _endpoint(options: FeetechOptions) -> Endpoint:
    return Endpoint("none") if options.port == "sim" else Endpoint("real", options.port)


plugin = DriverPlugin(
    options=FeetechOptions,
    make=FeetechDriver,
    budget=budget,
    scan=scan,
    hardware=True,
    summary="Feetech STS, SMS and HLS servos on a serial line",
    facts=facts,
    scan_options=ScanOptions,
    measure=_measure,
    endpoint=_endpoint,
    survey=survey,
    positions=True,
    foreseen=foreseen,
    columns="tautwave_drivers.feetech.driver:COLUMNS",
)

__all__ = ["FeetechDriver", "FeetechOptions", "ScanOptions", "plugin"]
