"""What a cycle of two axes costs this host, the drives' part left out: for `tautwave bench buses`.

Stand-ins of drives answer between the three calls of a cycle, so that nothing of theirs is timed.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Sequence
from typing import Protocol

import can

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec, Clock, CycleCost
from tautwave.errors import DriverError
from tautwave.types import AxisCommand
from tautwave_drivers.canopen.driver import CanopenDriver
from tautwave_drivers.canopen.exchange import SYNC_ID
from tautwave_drivers.canopen.frames import RawPort
from tautwave_drivers.canopen.mapping import RPDO_BASE, TPDO_BASE
from tautwave_drivers.canopen.options import CanopenOptions, Node
from tautwave_drivers.canopen.python_can import polled
from tautwave_drivers.cia402.states import ENABLE_OPERATION, SHUTDOWN, SWITCH_ON

NODES = (1, 2)
RAW_GOAL_US, VIRTUAL_GOAL_US = 25.0, 60.0
WARM_UP = 200
CHANNEL = "tautwave-bench"
_FRAME = struct.Struct("<IB3x8s")
_TPDO = struct.Struct("<Hib")
_STATES = {SHUTDOWN: 0x0231, SWITCH_ON: 0x0233, ENABLE_OPERATION: 0x1237}
_FAR_NS = 1_000_000_000


class End(Protocol):
    """An end of a transport, as bare as it can be."""

    def put(self, can_id: int, data: bytes) -> None: ...  # noqa: D102

    def take(self) -> tuple[int, bytes] | None: ...  # noqa: D102

    def close(self) -> None: ...  # noqa: D102


class SocketEnd:
    """A non-blocking datagram socket with the frames of SocketCAN."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end

    def put(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        self._end.send(_FRAME.pack(can_id, len(data), data))

    def take(self) -> tuple[int, bytes] | None:
        """Receive a frame, if there is one."""
        try:
            can_id, size, data = _FRAME.unpack(self._end.recv(_FRAME.size))
        except BlockingIOError:
            return None
        return can_id, data[:size]

    def close(self) -> None:
        """Close the socket."""
        self._end.close()


class BusEnd:
    """A python-can bus."""

    def __init__(self) -> None:
        self.bus = can.Bus(interface="virtual", channel=CHANNEL)

    def put(self, can_id: int, data: bytes) -> None:
        """Send a frame."""
        self.bus.send(can.Message(arbitration_id=can_id, data=data, is_extended_id=False))

    def take(self) -> tuple[int, bytes] | None:
        """Receive a frame, if there is one."""
        message = self.bus.recv(0)
        return None if message is None else (message.arbitration_id, bytes(message.data))

    def close(self) -> None:
        """Leave the bus."""
        self.bus.shutdown()


class StandIns:
    """Drives that do what the controlword says, and answer SYNC."""

    def __init__(self, end: End) -> None:
        self._end = end
        self._words = dict.fromkeys(NODES, 0x0250)
        self._position = 0

    def work(self) -> None:
        """Answer all that has come."""
        while (frame := self._end.take()) is not None:
            can_id, data = frame
            if can_id == SYNC_ID:
                self._position += 1  # moves, as a drive in use does
                for node in NODES:
                    answer = _TPDO.pack(self._words[node], self._position, 10)
                    self._end.put(TPDO_BASE[0] + node, answer)
            elif can_id - RPDO_BASE[0] in self._words:
                word = int.from_bytes(data[:2], "little")
                self._words[can_id - RPDO_BASE[0]] = _STATES.get(word & 0x8F, 0x0250)


def driver_times(driver: CanopenDriver, clock: Clock, end: End, cycles: int) -> list[float]:
    """Return the time of request, read and write of each cycle [us]; all answers are there."""
    drives = StandIns(end)
    for _ in range(100):
        if driver.enable_step():
            break
        drives.work()
    else:
        raise DriverError("bench: the stand-in drives were not enabled")
    tick = time.perf_counter_ns
    commands = [AxisCommand(0.01, 0.0)] * len(NODES)
    spent = []
    for _ in range(cycles + WARM_UP):
        first = tick()
        driver.request()
        time_ns = tick() - first
        drives.work()
        first = tick()
        states = driver.read(clock.now_ns() + _FAR_NS)
        driver.write(commands)
        time_ns += tick() - first
        drives.work()
        if not all(state.valid for state in states):
            raise DriverError(f"bench: an answer is missing: {list(driver.faults())}")
        spent.append(time_ns * 1e-3)
    return spent[WARM_UP:]


def bare_times(master: End, end: End, cycles: int) -> list[float]:
    """Return the time of the same five frames without a driver [us]."""
    drives = StandIns(end)
    tick = time.perf_counter_ns
    command = bytes(5)
    spent = []
    for _ in range(cycles + WARM_UP):
        first = tick()
        master.put(SYNC_ID, b"")
        time_ns = tick() - first
        drives.work()
        first = tick()
        for _ in NODES:
            master.take()
        for node in NODES:
            master.put(RPDO_BASE[0] + node, command)
        time_ns += tick() - first
        drives.work()
        spent.append(time_ns * 1e-3)
    return spent[WARM_UP:]


def _driver(clock: Clock, transport: object) -> CanopenDriver:
    axes = tuple(AxisSpec(f"bench.{node}", node, "rotary", "impedance", 1.0) for node in NODES)
    nodes = tuple(Node(id=node, rated_torque=0.5, counts_per_revolution=4096) for node in NODES)
    options = CanopenOptions(interface="virtual", channel=CHANNEL, nodes=nodes)
    return CanopenDriver(options, BusSpec("bench", axes, 1000.0), clock, transport)


def measure(cycles: int) -> Sequence[CycleCost]:
    """Return what a cycle of two axes costs on a raw socket and on python-can's virtual bus."""
    clock = MonotonicClock()
    raw: list[list[float]] = []
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    end = SocketEnd(theirs)
    driver = _driver(clock, None)
    driver.attach(RawPort(ours, clock, "bench"))
    try:
        raw.append(driver_times(driver, clock, end, cycles))
        raw.append(bare_times(SocketEnd(ours), end, cycles))
    finally:
        driver.detach()
        end.close()
        ours.close()
    virtual: list[list[float]] = []
    master, other = BusEnd(), BusEnd()
    driver = _driver(clock, None)
    driver.attach(polled(master.bus, clock, "bench"))
    try:
        virtual.append(driver_times(driver, clock, other, cycles))
        virtual.append(bare_times(master, other, cycles))
    finally:
        driver.detach()
        other.close()
    return [
        CycleCost("cycle, raw socket (datagram pair)", raw[0], raw[1], goal_us=RAW_GOAL_US),
        CycleCost("cycle, python-can virtual bus", virtual[0], virtual[1], goal_us=VIRTUAL_GOAL_US),
    ]
