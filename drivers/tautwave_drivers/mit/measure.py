"""The host's cost of a cycle of two motors, the motors excluded: for `tautwave bench buses`."""

from __future__ import annotations

import socket
import time
from collections.abc import Sequence
from contextlib import ExitStack

from tautwave.clock import MonotonicClock
from tautwave.contracts import Clock, CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.can.ends import End, SocketEnd
from tautwave_drivers.can.raw import RawPort
from tautwave_drivers.cost import Cycle, bench_bus, driver_cycle, in_turn
from tautwave_drivers.mit.driver import MitDriver
from tautwave_drivers.mit.options import MitOptions, Motor

IDS = (1, 2)
JOINTS = (1, 2, 3, 4, 5, 6, 7)
OFFSET = 16
GOAL_US, GOAL_RATIO = 25.0, 1.5
IN_TURN = 200


class StandIns:
    """Motors that answer every command, enabled and at rest."""

    def __init__(self, end: End, ids: Sequence[int] = IDS) -> None:
        self._end = end
        self._answers = {
            number: bytes((0x10 | number, 0x80, 0, 0x80, 0x08, 0, 25, 25)) for number in ids
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


def _driver(ids: Sequence[int], clock: Clock) -> MitDriver:
    motors = tuple(
        Motor(id=number, feedback_id=number + OFFSET, p_max=12.5, v_max=30.0, t_max=10.0)
        for number in ids
    )
    options = MitOptions(interface="virtual", channel="bench", motors=motors)
    return MitDriver(options, bench_bus(tuple(ids)), clock, None)


def measure(cycles: int) -> Sequence[CycleCost]:
    """Return what a cycle of two motors costs on a raw socket, and one of two arms of seven."""
    clock = MonotonicClock()
    with ExitStack() as stack:
        pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2)]
        ends = [(SocketEnd(ours), SocketEnd(theirs)) for ours, theirs in pairs]
        for end in (end for both in ends for end in both):
            stack.callback(end.close)
        driver = _driver(IDS, clock)
        driver.attach(RawPort(pairs[0][0], clock, "bench"))
        stand_ins = StandIns(ends[0][1])
        commands = [AxisCommand(0.01, 0.0)] * len(IDS)
        spent = driver_cycle(driver, clock, commands, stand_ins.work)
        raw = in_turn(cycles, spent, bare_cycle(*ends[1]), IN_TURN)
    return [
        CycleCost("cycle, raw socket (datagram pair)", *raw, goal_us=GOAL_US),
        CycleCost(
            "two buses of seven, over the same frames on the same ports",
            *_two_arms(cycles),
            goal_ratio=GOAL_RATIO,
        ),
    ]


def _two_arms(cycles: int) -> tuple[Sequence[float], Sequence[float]]:
    """Return the cost of two drivers of seven motors, and that of their 28 frames by the ports."""
    clock = MonotonicClock()
    tick = time.perf_counter_ns
    limit_ns = 10**9
    command = bytes(8)
    commands = [AxisCommand(0.01 * number, 0.0) for number in JOINTS]
    with ExitStack() as stack:
        drivers, ports, motors = [], [], []
        for _ in range(4):
            ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
            end = SocketEnd(theirs)
            stack.callback(end.close)
            stack.callback(ours.close)
            ports.append(RawPort(ours, clock, "bench"))
            motors.append(StandIns(end, JOINTS))
        for port in ports[:2]:
            drivers.append(_driver(JOINTS, clock))
            drivers[-1].attach(port)

        def answer() -> None:
            for one in motors:
                one.work()

        def driven() -> int:
            first = tick()
            for driver in drivers:
                driver.request()
            spent = tick() - first
            answer()
            first = tick()
            until = clock.now_ns() + limit_ns
            states = [driver.read(until) for driver in drivers]
            for driver in drivers:
                driver.write(commands)
            spent += tick() - first
            assert all(state.valid for bus in states for state in bus)
            return spent

        def bare() -> int:
            first = tick()
            for port in ports[2:]:
                for number in JOINTS:
                    port.send(number, command)
            spent = tick() - first
            answer()
            first = tick()
            for port in ports[2:]:
                for _ in JOINTS:
                    port.receive()
            return spent + tick() - first

        return in_turn(cycles, driven, bare, IN_TURN)
