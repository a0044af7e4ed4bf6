"""Simulated drives on a CAN interface that other processes share, with the wire's time kept.

Frames from the interface pass the simulated wire before a drive gets them, and those of the drives
before they are sent: no response is earlier than the bit rate allows.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import BusSpec
from tautwave.errors import ConfigError, DriverError
from tautwave.truth import AxisModel
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tautwave_sim.canopen.port import is_data_frame
from tautwave_sim.canopen.world import DriveBus

LOOK_NS = 50_000_000
"""[ns] How often it looks whether it was stopped."""
POLL_NS = 500_000
"""[ns] Polling interval of an interface that cannot be waited for."""


def open_bus(options: SimulatedCanopenOptions) -> Any:
    """Open a CAN interface through python-can.

    Raises
    ------
    DriverError
        It is not there, or python-can is not installed.
    """
    try:
        import can
    except ImportError as err:
        raise DriverError("canopen needs python-can: pip install tautwave[canopen]") from err
    # Without a handler Python prints the library's warnings on stderr.
    logging.getLogger("can").addHandler(logging.NullHandler())
    keys: dict[str, Any] = {}
    if options.interface not in ("socketcan", "udp_multicast", "virtual"):
        keys["bitrate"] = options.bitrate
    try:
        return can.Bus(interface=options.interface, channel=options.channel, **keys)
    except Exception as err:  # a missing vendor's library also ends in NameError, TypeError ...
        raise DriverError(
            f"cannot open {options.interface}:{options.channel}: {err}; bring the interface up, or "
            "use interface udp_multicast with channel 239.74.163.2, which needs no CAN in the "
            "kernel"
        ) from err


class Gateway:
    """Carries frames between an interface and the simulated wire.

    Parameters
    ----------
    world : DriveBus
        The drives.
    bus : can.BusABC
        The interface.
    """

    def __init__(self, world: DriveBus, bus: Any) -> None:
        import can

        self._can = can
        self._bus = bus
        self._world = world
        self._sent: set[int] = set()
        self._port = world.medium.port(self._out)
        self.dropped = 0
        """Frames that the interface rejected."""

    def _out(self, now_ns: int, can_id: int, data: bytes) -> None:
        self._sent.add(can_id)
        message = self._can.Message(arbitration_id=can_id, data=data, is_extended_id=False)
        try:
            self._bus.send(message)
        except (self._can.CanError, OSError):
            self.dropped += 1  # full or down: the frame is lost, as on a wire

    def run(self, now_ns: int) -> None:
        """Take what has come and advance the wire to `now_ns`."""
        self._world.port_fault(self._port)  # of the plan's port faults, what breaks the wire
        self._world.advance(now_ns)
        try:
            while (message := self._bus.recv(0.0)) is not None:
                # udp_multicast echoes the sender's own frames; no other node uses their ids.
                if is_data_frame(message) and message.arbitration_id not in self._sent:
                    self._port.send(message.arbitration_id, bytes(message.data))
        except (self._can.CanError, OSError):
            self.dropped += 1  # the interface went down; it may come back


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
    faults = options.simulator.faults
    if faults.queue_full > 0.0 or any(event.kind == "queue_full" for event in faults.events):
        raise ConfigError(
            f"bus {bus.name}: simulator.faults: queue_full would do nothing on "
            f"{options.interface}, where the master's queue is the interface's own; take it out, "
            "or run with interface virtual or --clock fake"
        )
    interface = open_bus(options)
    try:
        clock = MonotonicClock()
        world = DriveBus(options, bus, physics, clock.now_ns())
        gateway = Gateway(world, interface)
        waits = _can_be_waited_for(interface)
        announce(
            {
                "driver": "canopen",
                "endpoint": f"{options.interface}:{options.channel}",
                "nodes": [axis.device_id for axis in bus.axes],
                "options": {},
            }
        )
        while not stopped():
            now_ns = clock.now_ns()
            gateway.run(now_ns)
            event = world.next_event_ns()
            until = now_ns + LOOK_NS if event is None else min(event, now_ns + LOOK_NS)
            if waits:
                clock.wait(interface, until)
            else:
                clock.sleep_until(min(until, now_ns + POLL_NS))
    finally:
        interface.shutdown()


def _can_be_waited_for(interface: Any) -> bool:
    try:
        return bool(interface.fileno() >= 0)
    except NotImplementedError:  # how python-can says that an interface has no descriptor
        return False
