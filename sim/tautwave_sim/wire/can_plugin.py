"""The plugin of simulated devices on CAN: in this process, or on an interface that others share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from tautwave.contracts import BusSpec, Clock, SimulatorPlugin
from tautwave.truth import AxisModel
from tautwave_sim.wire.can_port import MasterPort, VirtualPort
from tautwave_sim.wire.can_served import refuse_full_queue, serve_world
from tautwave_sim.wire.can_world import CanOptions, CanWorld

MakeWorld = Callable[[Any, BusSpec, Sequence[AxisModel], int], CanWorld]
"""Of options, bus, one truth per axis, and the time when everything is switched on [ns]."""


class CanSimulator:
    """Devices and their bus in this process.

    Parameters
    ----------
    make : callable
        Makes the devices.
    options : CanOptions
        The bus and its devices.
    bus : BusSpec
        Axes and rate.
    physics : sequence of AxisModel
        One per axis.
    clock : Clock
        A real one puts python-can's virtual bus between master and devices.
    """

    def __init__(
        self,
        make: MakeWorld,
        options: CanOptions,
        bus: BusSpec,
        physics: Sequence[AxisModel],
        clock: Clock,
    ) -> None:
        self.world = make(options, bus, physics, clock.now_ns())
        self.axes = self.world.axes
        self.arms = self.world.arms
        depth = options.simulator.queue
        self.transport: MasterPort
        if getattr(clock, "real", False):
            self.transport = VirtualPort(self.world, clock, depth, options.channel)
        else:
            self.transport = MasterPort(self.world, clock, depth)

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        self.transport.advance(to_ns)

    def close(self) -> None:
        """Leave the virtual bus, if there is one."""
        if isinstance(self.transport, VirtualPort):
            self.transport.shut()


def _served(options: CanOptions) -> bool:
    return options.interface != "virtual"


def _instead(options: CanOptions) -> Mapping[str, Any]:
    return {"interface": "virtual"}  # only this process can be on it


def can_plugin(driver: str, listed: str, make: MakeWorld, **declared: Any) -> SimulatorPlugin:
    """Return the plugin of a kind of devices on CAN.

    Parameters
    ----------
    driver : str
        Name of the driver that the devices answer.
    listed : str
        The option that lists the devices, as in `nodes`.
    make : callable
        Makes the devices.
    **declared
        What else a `SimulatorPlugin` declares: options, summary, bench.
    """

    def serve(
        options: CanOptions,
        bus: BusSpec,
        physics: Sequence[AxisModel],
        announce: Callable[[Mapping[str, Any]], None],
        stopped: Callable[[], bool],
    ) -> None:
        """Run simulated devices on a real interface until `stopped()`.

        Raises
        ------
        ConfigError
            The plan fills a queue that is not here: the master's is the kernel's.
        DriverError
            The interface cannot be opened.
        """
        refuse_full_queue(bus.name, options.interface, options.simulator.faults)
        ready = {
            "driver": driver,
            "endpoint": f"{options.interface}:{options.channel}",
            listed: [axis.device_id for axis in bus.axes],
            "options": {},
        }
        made = partial(make, options, bus, physics)
        serve_world(options, made, partial(announce, ready), stopped)

    return SimulatorPlugin(
        make=partial(CanSimulator, make), served=_served, serve=serve, instead=_instead, **declared
    )
