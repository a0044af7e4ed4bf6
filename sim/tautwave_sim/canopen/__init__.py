"""Simulated CiA 402 drives on CANopen: device, drive and motor behind a bus with wire time."""

from __future__ import annotations

from tautwave_sim.canopen.bench import CanopenBench, bench
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tautwave_sim.canopen.world import DriveBus
from tautwave_sim.wire.can_plugin import can_plugin

simulator = can_plugin(
    "canopen",
    "nodes",
    DriveBus,
    options=SimulatedCanopenOptions,
    summary="CiA 402 drives on CANopen, with wire time",
    bench_options=CanopenBench,
    bench=bench,
)
