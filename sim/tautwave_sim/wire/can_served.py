"""Simulated devices on a CAN interface that other processes share, with the wire's time kept.

Frames from the interface pass the simulated wire before a device gets them, and those of devices
before they are sent: no response is earlier than the bit rate allows.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.errors import ConfigError, DriverError
from tautwave.multicast import only_its_group
from tautwave_sim.wire.can_faults import CanFaults
from tautwave_sim.wire.can_port import frame_of, message_of
from tautwave_sim.wire.can_world import CanOptions, CanWorld

LOOK_NS = 50_000_000
"""[ns] How often it looks whether it was stopped."""
POLL_NS = 500_000
"""[ns] Polling interval of an interface that cannot be waited for."""
ECHO_NS = 100_000_000
"""[ns] An own frame that an interface returns is back within that time."""


def open_bus(options: CanOptions) -> Any:
    """Open a CAN interface through python-can.

    Raises
    ------
    DriverError
        It is not there, or python-can is not installed.
    """
    try:
        import can
    except ImportError as err:
        raise DriverError("a CAN bus needs python-can: pip install tautwave[canopen]") from err
    # Without a handler Python prints the library's warnings on stderr.
    logging.getLogger("can").addHandler(logging.NullHandler())
    keys: dict[str, Any] = {}
    if options.interface not in ("socketcan", "udp_multicast", "virtual"):
        keys["bitrate"] = options.bitrate
        if options.data_bitrate is not None:
            keys |= {"fd": True, "data_bitrate": options.data_bitrate}
    elif options.interface == "socketcan" and options.data_bitrate is not None:
        keys["fd"] = True
    try:
        bus = can.Bus(interface=options.interface, channel=options.channel, **keys)
    except Exception as err:  # a missing vendor's library also ends in NameError, TypeError ...
        raise DriverError(
            f"cannot open {options.interface}:{options.channel}: {err}; bring the interface up, or "
            "use interface udp_multicast with channel 239.74.163.2, which needs no CAN in the "
            "kernel"
        ) from err
    only_its_group(bus)
    return bus


class Gateway:
    """Carries frames between an interface and the simulated wire.

    Its own frames, which some interfaces return, are known by content and count.

    Parameters
    ----------
    world : CanWorld
        The devices.
    bus : can.BusABC
        The interface.
    """

    def __init__(self, world: CanWorld, bus: Any) -> None:
        import can

        self._can = can
        self._bus = bus
        self._world = world
        self._sent: dict[tuple[int, bytes], deque[int]] = {}
        self._now_ns = 0
        self._port = world.medium.port(self._out)
        self.dropped = 0
        """Frames that the interface rejected."""

    def _out(self, now_ns: int, can_id: int, data: bytes) -> None:
        message = message_of(can_id, data, self._world.medium.fd)
        try:
            self._bus.send(message)
        except (self._can.CanError, OSError):
            self.dropped += 1  # full or down: the frame is lost, as on a wire
            return
        self._sent.setdefault((can_id, data), deque(maxlen=64)).append(self._now_ns)

    def _came_back(self, can_id: int, data: bytes) -> bool:
        times = self._sent.get((can_id, data))
        while times:
            if times.popleft() >= self._now_ns - ECHO_NS:
                return True
        self._sent.pop((can_id, data), None)
        return False

    def run(self, now_ns: int) -> None:
        """Take what has come and advance the wire to `now_ns`."""
        self._now_ns = now_ns
        self._world.port_fault(self._port)  # of the plan's port faults, what breaks the wire
        self._world.advance(now_ns)
        if len(self._sent) > 1000:
            oldest = now_ns - ECHO_NS
            self._sent = {key: at for key, at in self._sent.items() if at and at[-1] >= oldest}
        try:
            while (message := self._bus.recv(0.0)) is not None:
                frame = frame_of(message, self._world)
                if frame is not None and not self._came_back(*frame[:2]):
                    self._port.send(*frame)
        except (self._can.CanError, OSError):
            self.dropped += 1  # the interface went down; it may come back


def refuse_full_queue(bus: str, interface: str, faults: CanFaults) -> None:
    """Refuse a plan that fills a queue that is not here: the master's is the kernel's.

    Raises
    ------
    ConfigError
        It does.
    """
    if faults.queue_full > 0.0 or any(event.kind == "queue_full" for event in faults.events):
        raise ConfigError(
            f"bus {bus}: simulator.faults: queue_full would do nothing on "
            f"{interface}, where the master's queue is the interface's own; take it out, "
            "or run with interface virtual or --clock fake"
        )


def serve_world(
    options: CanOptions,
    make: Callable[[int], CanWorld],
    announce: Callable[[], None],
    stopped: Callable[[], bool],
) -> None:
    """Run simulated devices on a real interface until `stopped()`.

    Parameters
    ----------
    make : callable
        Makes the devices at a time [ns].
    announce : callable
        Called once they are there.

    Raises
    ------
    DriverError
        The interface cannot be opened.
    """
    interface = open_bus(options)
    try:
        clock = MonotonicClock()
        world = make(clock.now_ns())
        gateway = Gateway(world, interface)
        waits = _can_be_waited_for(interface)
        announce()
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
