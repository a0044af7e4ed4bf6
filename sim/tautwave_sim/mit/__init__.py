"""Simulated MIT motors on CAN and CAN FD (Damiao), for the driver and for anybody else's client."""

from __future__ import annotations

from tautwave_sim.mit.bench import MitBench, bench
from tautwave_sim.mit.options import SimulatedMitOptions
from tautwave_sim.mit.world import MotorBus
from tautwave_sim.wire.can_plugin import can_plugin

simulator = can_plugin(
    "mit",
    "motors",
    MotorBus,
    options=SimulatedMitOptions,
    summary="MIT motors (Damiao) on CAN and CAN FD, RobStride, with wire time",
    bench_options=MitBench,
    bench=bench,
    arms=True,
)
