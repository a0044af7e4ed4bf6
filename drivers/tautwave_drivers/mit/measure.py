"""The host's cost of a cycle of two motors, the motors excluded: for `tautwave bench buses`."""

from __future__ import annotations

import socket
import time
from collections.abc import Sequence
from contextlib import ExitStack

from tautwave.clock import MonotonicClock
from tautwave.contracts import CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.can.ends import End, SocketEnd
from tautwave_drivers.can.raw import RawPort
from tautwave_drivers.cost import Cycle, bench_bus, driver_cycle, in_turn
from tautwave_drivers.mit.driver import MitDriver
from tautwave_drivers.mit.options import MitOptions, Motor

IDS = (1, 2)
OFFSET = 16
GOAL_US = 25.0
IN_TURN = 200


class StandIns:
    """Motors that answer every command, enabled and at rest."""

    def __init__(self, end: End) -> None:
        self._end = end
        self._answers = {
            number: bytes((0x10 | number, 0x80, 0, 0x80, 0x08, 0, 25, 25)) for number in IDS
        }

    def work(self) -> None:
        """Answer all that has come."""
        while (frame := self._end.take()) is not None:
            answer = self._answers.get(frame[0])
            if answer is not None:
                self._end.put(frame[0] + OFFSET, answer)


def bare_cycle(master: End, end: End) -> Cycle:
    """Return the work of the same four frames without a driver; returns its time."""
    motors = StandIns(end)
    tick = time.perf_counter_ns
    command = bytes(8)

    def cycle() -> int:
        first = tick()
        for number in IDS:
            master.put(number, command)
        spent = tick() - first
        motors.work()
        first = tick()
        for _ in IDS:
            master.take()
        return spent + tick() - first

    return cycle


def measure(cycles: int) -> Sequence[CycleCost]:
    """Return what a cycle of two motors costs on a raw socket."""
    clock = MonotonicClock()
    motors = tuple(
        Motor(id=number, feedback_id=number + OFFSET, p_max=12.5, v_max=30.0, t_max=10.0)
        for number in IDS
    )
    with ExitStack() as stack:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2)]
        ends = [(SocketEnd(ours), SocketEnd(theirs)) for ours, theirs in pairs]
        for end in (end for both in ends for end in both):
            stack.callback(end.close)
        driver = MitDriver(
            MitOptions(interface="virtual", channel="bench", motors=motors),
            bench_bus(IDS),
            clock,
            None,
        )
        driver.attach(RawPort(pairs[0][0], clock, "bench"))
        stand_ins = StandIns(ends[0][1])
        commands = [AxisCommand(0.01, 0.0)] * len(IDS)
        spent = driver_cycle(driver, clock, commands, stand_ins.work)
        raw = in_turn(cycles, spent, bare_cycle(*ends[1]), IN_TURN)
    return [CycleCost("cycle, raw socket (datagram pair)", *raw, goal_us=GOAL_US)]
