"""The simulator plugin of MIT motors; python-can is imported where a bus is opened."""

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
