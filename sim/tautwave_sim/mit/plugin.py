"""The simulator plugin of MIT motors; python-can is imported where a bus is opened."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock, SimulatorPlugin
from tautwave.truth import AxisModel
from tautwave_sim.mit.bench import MitBench, bench
from tautwave_sim.mit.options import SimulatedMitOptions
from tautwave_sim.mit.world import MotorBus
from tautwave_sim.wire.can_port import MasterPort, VirtualPort
from tautwave_sim.wire.can_served import refuse_full_queue, serve_world


class MitSimulator:
    """Motors and their bus in this process.

    Parameters
    ----------
    options : SimulatedMitOptions
        The bus and its motors.
    bus : BusSpec
        Axes and rate.
    physics : sequence of AxisModel
        One per axis.
    clock : Clock
        A real one puts python-can's virtual bus between master and motors.
    """

    def __init__(
        self,
        options: SimulatedMitOptions,
        bus: BusSpec,
        physics: Sequence[AxisModel],
        clock: Clock,
    ) -> None:
        self.world = MotorBus(options, bus, physics, clock.now_ns())
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


def serve(
    options: SimulatedMitOptions,
    bus: BusSpec,
    physics: Sequence[AxisModel],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    """Run simulated motors on a real interface until `stopped()`.

    Raises
    ------
    ConfigError
        The plan fills a queue that is not here: the master's is the kernel's.
    DriverError
        The interface cannot be opened.
    """
    refuse_full_queue(bus.name, options.interface, options.simulator.faults)
    ready = {
        "driver": "mit",
        "endpoint": f"{options.interface}:{options.channel}",
        "motors": [axis.device_id for axis in bus.axes],
        "options": {},
    }
    serve_world(
        options,
        lambda now_ns: MotorBus(options, bus, physics, now_ns),
        lambda: announce(ready),
        stopped,
    )


def _served(options: SimulatedMitOptions) -> bool:
    return options.interface != "virtual"


def _instead(options: SimulatedMitOptions) -> Mapping[str, Any]:
    return {"interface": "virtual"}  # only this process can be on it


simulator = SimulatorPlugin(
    options=SimulatedMitOptions,
    make=MitSimulator,
    summary="MIT motors (Damiao) on CAN and CAN FD, with wire time",
    served=_served,
    serve=serve,
    bench_options=MitBench,
    bench=bench,
    instead=_instead,
)
