"""The host's cost of a cycle of two axes, drives excluded: for `tautwave bench buses`.

Stand-ins of drives respond between the three calls of a cycle, so that their work is not timed.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Sequence
from contextlib import ExitStack

from tautwave.clock import MonotonicClock
from tautwave.contracts import Clock, CycleCost, FramePort
from tautwave.errors import DriverError
from tautwave.types import AxisCommand
from tautwave_drivers.can.ends import BusEnd, End, SocketEnd
from tautwave_drivers.can.python_can import port_kind
from tautwave_drivers.can.raw import RawPort
from tautwave_drivers.canopen.driver import CanopenDriver
from tautwave_drivers.canopen.health import SYNC_ID
from tautwave_drivers.canopen.mapping import RPDO_1, TPDO_1
from tautwave_drivers.canopen.options import CanopenOptions, Node
from tautwave_drivers.cia402.states import ENABLE_OPERATION, SHUTDOWN, SWITCH_ON
from tautwave_drivers.cost import Cycle, bench_bus, driver_cycle, in_turn

NODES = (1, 2)
RAW_GOAL_US, VIRTUAL_GOAL_US = 25.0, 60.0
IN_TURN = 200
CHANNEL = "tautwave-bench"
_TPDO = struct.Struct("<Hib")
_STATES = {SHUTDOWN: 0x0231, SWITCH_ON: 0x0233, ENABLE_OPERATION: 0x1237}


class StandIns:
    """Drives that follow the controlword, and respond to SYNC."""

    def __init__(self, end: End) -> None:
        self._end = end
        self._words = dict.fromkeys(NODES, 0x0250)
        self._position = 0

    def work(self) -> None:
        """Respond to all that has come."""
        while (frame := self._end.take()) is not None:
            can_id, data = frame
            if can_id == SYNC_ID:
                self._position += 1  # moves, as a drive in use does
                for node in NODES:
                    response = _TPDO.pack(self._words[node], self._position, 10)
                    self._end.put(TPDO_1 + node, response)
            elif can_id - RPDO_1 in self._words:
                word = int.from_bytes(data[:2], "little")
                self._words[can_id - RPDO_1] = _STATES.get(word & 0x8F, 0x0250)


def enabled_cycle(driver: CanopenDriver, clock: Clock, end: End) -> Cycle:
    """Return the work of a cycle with all TPDOs in."""
    drives = StandIns(end)
    for _ in range(100):
        if driver.enable_step():
            break
        drives.work()
    else:
        raise DriverError("bench: the stand-in drives were not enabled")
    return driver_cycle(driver, clock, [AxisCommand(0.01, 0.0)] * len(NODES), drives.work)


def bare_cycle(master: End, end: End) -> Cycle:
    """Return the work of the same five frames without a driver; returns its time."""
    drives = StandIns(end)
    tick = time.perf_counter_ns
    command = bytes(5)

    def cycle() -> int:
        first = tick()
        master.put(SYNC_ID, b"")
        spent = tick() - first
        drives.work()
        first = tick()
        for _ in NODES:
            master.take()
        for node in NODES:
            master.put(RPDO_1 + node, command)
        spent += tick() - first
        drives.work()
        return spent

    return cycle


def _driver(clock: Clock, port: FramePort) -> CanopenDriver:
    nodes = tuple(Node(id=node, rated_torque=0.5, counts_per_revolution=4096) for node in NODES)
    options = CanopenOptions(interface="virtual", channel=CHANNEL, nodes=nodes)
    driver = CanopenDriver(options, bench_bus(NODES), clock, None)
    driver.attach(port)
    return driver


def measure(cycles: int) -> Sequence[CycleCost]:
    """Return what a cycle of two axes costs on a raw socket and on python-can's virtual bus."""
    clock = MonotonicClock()
    with ExitStack() as stack:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2)]
        ends = [(SocketEnd(ours), SocketEnd(theirs)) for ours, theirs in pairs]
        for end in (end for both in ends for end in both):
            stack.callback(end.close)
        driver = _driver(clock, RawPort(pairs[0][0], clock, "bench"))
        raw = in_turn(
            cycles, enabled_cycle(driver, clock, ends[0][1]), bare_cycle(*ends[1]), IN_TURN
        )
    with ExitStack() as stack:
        buses = [BusEnd(f"{CHANNEL}-{at // 2}") for at in range(4)]
        for bus in buses:
            stack.callback(bus.close)
        driver = _driver(clock, port_kind(buses[0].bus)(buses[0].bus, clock, "bench"))
        virtual = in_turn(
            cycles, enabled_cycle(driver, clock, buses[1]), bare_cycle(buses[2], buses[3]), IN_TURN
        )
    return [
        CycleCost("cycle, raw socket (datagram pair)", *raw, goal_us=RAW_GOAL_US),
        CycleCost("cycle, python-can virtual bus", *virtual, goal_us=VIRTUAL_GOAL_US),
    ]
