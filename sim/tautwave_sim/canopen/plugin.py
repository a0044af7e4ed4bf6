"""The simulator plugin of CANopen; python-can is imported when a bus is opened, and only then."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock, SimulatorPlugin
from tautwave.truth import AxisModel
from tautwave_sim.canopen.bench import CanopenBench, bench
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tautwave_sim.canopen.served import serve
from tautwave_sim.canopen.world import DriveBus
from tautwave_sim.wire.can_port import MasterPort, VirtualPort


class CanopenSimulator:
    """Drives and their bus in this process.

    Parameters
    ----------
    options : SimulatedCanopenOptions
        The bus and its nodes.
    bus : BusSpec
        Axes and rate.
    physics : sequence of AxisModel
        One per axis.
    clock : Clock
        A real one puts python-can's virtual bus between master and drives.
    """

    def __init__(
        self,
        options: SimulatedCanopenOptions,
        bus: BusSpec,
        physics: Sequence[AxisModel],
        clock: Clock,
    ) -> None:
        self.world = DriveBus(options, bus, physics, clock.now_ns())
        self.axes = self.world.axes
        depth = options.simulator.queue
        self.transport: MasterPort
        if getattr(clock, "real", False):
            self.transport = VirtualPort(self.world, clock, depth, options.channel)
        else:
            self.transport = MasterPort(self.world, clock, depth)

    def advance(self, to_ns: int) -> None:
        """Let everything happen that happens up to `to_ns`."""
        self.transport.advance(to_ns)

    def close(self) -> None:
        """Leave the virtual bus, if there is one."""
        if isinstance(self.transport, VirtualPort):
            self.transport.shut()


def _served(options: SimulatedCanopenOptions) -> bool:
    return options.interface != "virtual"


def _instead(options: SimulatedCanopenOptions) -> Mapping[str, Any]:
    return {"interface": "virtual"}  # only this process can be on it


simulator = SimulatorPlugin(
    options=SimulatedCanopenOptions,
    make=CanopenSimulator,
    summary="CiA 402 drives on CANopen, with wire time",
    served=_served,
    serve=serve,
    bench_options=CanopenBench,
    bench=bench,
    instead=_instead,
)
