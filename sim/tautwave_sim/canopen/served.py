"""Simulated drives on a CAN interface that other processes share."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.contracts import BusSpec
from tautwave.truth import AxisModel
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tautwave_sim.canopen.world import DriveBus
from tautwave_sim.wire.can_served import refuse_full_queue, serve_world


def serve(
    options: SimulatedCanopenOptions,
    bus: BusSpec,
    physics: Sequence[AxisModel],
    announce: Callable[[Mapping[str, Any]], None],
    stopped: Callable[[], bool],
) -> None:
    """Run simulated drives on a real interface until `stopped()`.

    Raises
    ------
    ConfigError
        The plan fills a queue that is not here: the master's is the kernel's.
    DriverError
        The interface cannot be opened.
    """
    refuse_full_queue(bus.name, options.interface, options.simulator.faults)
    ready = {
        "driver": "canopen",
        "endpoint": f"{options.interface}:{options.channel}",
        "nodes": [axis.device_id for axis in bus.axes],
        "options": {},
    }
    serve_world(
        options,
        lambda now_ns: DriveBus(options, bus, physics, now_ns),
        lambda: announce(ready),
        stopped,
    )
