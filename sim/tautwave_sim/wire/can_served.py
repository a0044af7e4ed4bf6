"""Simulated devices on a CAN interface that other processes share, with the wire's time kept.

Frames from the interface pass the simulated wire before a device gets them, and those of devices
before they are sent: no response is earlier than the bit rate allows.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable
from typing import Any, Protocol

from tautwave.clock import MonotonicClock
from tautwave.contracts import Clock
from tautwave.errors import ConfigError, DriverError
from tautwave.multicast import ERROR, EXTENDED, REMOTE, Group, GroupFrame
from tautwave_sim.wire.can_faults import CanFaults
from tautwave_sim.wire.can_port import linux_frame, message_of
from tautwave_sim.wire.can_world import CanOptions, CanWorld

LOOK_NS = 50_000_000
"""[ns] How often it looks whether it was stopped."""
POLL_NS = 500_000
"""[ns] Polling interval of an interface that cannot be waited for."""
MANY = 64
"""Frames that are taken at once."""
MANY_SENT = 1000
ECHO_NS = 100_000_000
"""[ns] An own frame that an interface returns is back within that time."""


class Interface(Protocol):
    """An interface that others share."""

    def send(self, can_id: int, data: bytes, fd: bool) -> bool:
        """Send a frame, its identifier as Linux has it; False: no room. May raise OSError."""

    def receive_some(self, most: int) -> list[GroupFrame]:
        """Return frames of others, oldest first: id, data, FD, monotonic time [ns] or 0."""

    def close(self) -> None:
        """Leave it."""


class PythonCan:
    """Any interface of python-can.

    Its own frames, which some interfaces return, are known by content and count.

    Parameters
    ----------
    bus : can.BusABC
        The open bus.
    clock : Clock
        Time by which an echo is expected.
    """

    def __init__(self, bus: Any, clock: Clock) -> None:
        import can

        self._failures = can.CanError
        self._bus = bus
        self._now_ns = clock.now_ns
        self._sent: dict[tuple[int, bytes], deque[int]] = {}
        try:
            waits = bus.fileno() >= 0
        except NotImplementedError:  # how python-can says that an interface has no descriptor
            waits = False
        if waits:
            self.fileno = bus.fileno

    def send(self, can_id: int, data: bytes, fd: bool) -> bool:
        """Send a frame; False where the interface is full or down."""
        try:
            self._bus.send(message_of(can_id, data, fd))
        except (self._failures, OSError):
            return False
        now_ns = self._now_ns()
        if len(self._sent) > MANY_SENT:
            oldest = now_ns - ECHO_NS
            self._sent = {key: at for key, at in self._sent.items() if at and at[-1] >= oldest}
        self._sent.setdefault((can_id, data), deque(maxlen=64)).append(now_ns)
        return True

    def _came_back(self, can_id: int, data: bytes) -> bool:
        times = self._sent.get((can_id, data))
        while times:
            if times.popleft() >= self._now_ns() - ECHO_NS:
                return True
        self._sent.pop((can_id, data), None)
        return False

    def receive_some(self, most: int) -> list[GroupFrame]:
        """Return frames of others, oldest first."""
        frames: list[GroupFrame] = []
        try:
            while len(frames) < most and (message := self._bus.recv(0.0)) is not None:
                frame = linux_frame(message)
                if not self._came_back(*frame[:2]):
                    frames.append((*frame, 0))
        except self._failures as err:
            if not frames:
                raise OSError(str(err)) from err
        return frames

    def close(self) -> None:
        """Close the bus."""
        self._bus.shutdown()


def open_interface(options: CanOptions, clock: Clock) -> Interface:
    """Open a CAN interface: a group of UDP multicast, or any other through python-can.

    Raises
    ------
    DriverError
        It is not there, or python-can is not installed.
    """
    try:
        if options.interface == "udp_multicast":
            return Group(options.channel, stamped=True)
        import can
    except ImportError as err:
        raise DriverError("a CAN bus needs python-can: pip install tautwave[canopen]") from err
    except OSError as err:
        raise _not_there(options, err) from err
    # Without a handler Python prints the library's warnings on stderr.
    logging.getLogger("can").addHandler(logging.NullHandler())
    keys: dict[str, Any] = {}
    if options.interface not in ("socketcan", "virtual"):
        keys["bitrate"] = options.bitrate
        if options.data_bitrate is not None:
            keys |= {"fd": True, "data_bitrate": options.data_bitrate}
    elif options.interface == "socketcan" and options.data_bitrate is not None:
        keys["fd"] = True
    try:
        return PythonCan(
            can.Bus(interface=options.interface, channel=options.channel, **keys), clock
        )
    except Exception as err:  # a missing vendor's library also ends in NameError, TypeError ...
        raise _not_there(options, err) from err


def _not_there(options: CanOptions, err: Exception) -> DriverError:
    return DriverError(
        f"cannot open {options.interface}:{options.channel}: {err}; bring the interface up, or "
        "use interface udp_multicast with channel 239.74.163.2, which needs no CAN in the "
        "kernel"
    )


class Gateway:
    """Carries frames between an interface and the simulated wire.

    A frame is on the wire from when the kernel got it, where the interface says so: that this
    process came to it later delays no answer.

    Parameters
    ----------
    world : CanWorld
        The devices.
    interface : Interface
        Where the frames of others come from.
    """

    def __init__(self, world: CanWorld, interface: Interface) -> None:
        self._interface = interface
        self._world = world
        self._port = world.medium.port(self._out)
        self._others = REMOTE | ERROR | (0 if world.extended else EXTENDED)
        self.dropped = 0
        """Frames that the interface rejected."""

    def _out(self, now_ns: int, can_id: int, data: bytes) -> None:
        try:
            if self._interface.send(can_id, data, self._world.medium.fd):
                return
        except OSError:
            pass
        self.dropped += 1  # full or down: the frame is lost, as on a wire

    def run(self, now_ns: int) -> None:
        """Take what has come and advance the wire to `now_ns`."""
        world, fd = self._world, self._world.medium.timing.fd
        world.port_fault(self._port)  # of the plan's port faults, what breaks the wire
        try:
            while frames := self._interface.receive_some(MANY):
                for can_id, data, is_fd, at_ns in frames:
                    world.advance(at_ns or now_ns)
                    if not can_id & self._others and (fd or not is_fd):
                        self._port.send(can_id, data, is_fd)
        except OSError:
            self.dropped += 1  # the interface went down; it may come back
        world.advance(now_ns)

    def next_event_ns(self) -> int | None:
        """Return a time before which there is nothing to be sent."""
        return self._world.next_heard_ns(self._port)


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
    clock = MonotonicClock()
    interface = open_interface(options, clock)
    try:
        world = make(clock.now_ns())
        gateway = Gateway(world, interface)
        waits = hasattr(interface, "fileno")
        announce()
        while not stopped():
            now_ns = clock.now_ns()
            gateway.run(now_ns)
            event = gateway.next_event_ns()
            until = now_ns + LOOK_NS if event is None else min(event, now_ns + LOOK_NS)
            if waits:
                clock.wait(interface, until)
            else:
                clock.sleep_until(min(until, now_ns + POLL_NS))
    finally:
        interface.close()
