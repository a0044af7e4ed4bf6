"""The host's cost of one exchange of two servos over a pseudo-terminal, device excluded.

The other end is a process that answers the same bytes to every question of the right length, so
nothing but our side differs between the driver, dynamixel-sdk and the floor: the same bytes written
and read back with nothing made of them. They take turns in short chunks in one run.
"""

from __future__ import annotations

import contextlib
import gc
import importlib.util
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec, CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.dynamixel import packet
from tautwave_drivers.dynamixel import registers as reg
from tautwave_drivers.dynamixel.driver import DynamixelDriver
from tautwave_drivers.dynamixel.exchange import Goals
from tautwave_drivers.dynamixel.line import Line, OwnLine
from tautwave_drivers.dynamixel.options import DynamixelOptions
from tautwave_drivers.dynamixel.port import SerialPort
from tautwave_drivers.dynamixel.sdk import SdkLine

IDS = (1, 2)
BAUD = 4_000_000
CHUNK = 20
"""Exchanges of one kind in a row, before the next has its turn."""
GOAL_RATIO = 1.5
LIMIT_NS = 50_000_000

RESPONDER = """
import os, sys
port, question, answer = int(sys.argv[1]), int(sys.argv[2]), bytes.fromhex(sys.argv[3])
have = 0
while True:
    have += len(os.read(port, 4096))
    while have >= question:
        have -= question
        os.write(port, answer)
"""

Cycle = Callable[[], None]


def measure(cycles: int) -> Sequence[CycleCost]:
    """Measure sync read, fast sync read and a plain read, ours and the SDK's, over the floor.

    Parameters
    ----------
    cycles : int
        Exchanges per figure.
    """
    costs = []
    for kind, ours, theirs in (
        ("2 servos, sync write and sync read", _own_sync, _sdk_sync),
        ("2 servos, sync write and fast sync read", _own_fast, _sdk_fast),
        ("1 servo, 4 bytes read before the loop", _own_read, _sdk_read),
    ):
        goal = GOAL_RATIO if ours is not _own_read else None
        what = f"{kind} over a pty"
        spent, floor = _in_turn(ours, _bytes(kind), cycles)
        costs.append(CycleCost(f"{what}, ours", spent, floor, goal_ratio=goal))
        what = f"{what}, dynamixel-sdk"
        if not _has_sdk():
            costs.append(CycleCost(what, why_not="dynamixel-sdk is not installed"))
            continue
        costs.append(CycleCost(what, *_in_turn(theirs, _bytes(kind), cycles)))
    return costs


def _has_sdk() -> bool:
    return importlib.util.find_spec("dynamixel_sdk") is not None


def _in_turn(
    make: Callable[[str], tuple[Cycle, Cycle]], traffic: tuple[bytes, bytes], cycles: int
) -> tuple[list[float], list[float]]:
    """Return the times of one kind of cycle and of its floor [us], in turns of `CHUNK`."""
    spent: list[float] = []
    floor: list[float] = []
    question, answer = traffic
    with _responder(len(question), answer) as (path, port):
        cycle, release = make(path)
        gc.collect()
        gc.disable()  # as in the loop
        try:
            for _ in range(CHUNK):
                cycle()
            while len(spent) < cycles:
                _timed(cycle, spent)
                _timed(lambda: _bare(port, question, len(answer)), floor)
        finally:
            gc.enable()
            release()
    return spent[:cycles], floor[:cycles]


def _timed(cycle: Cycle, into: list[float]) -> None:
    for _ in range(CHUNK):
        began = time.perf_counter_ns()
        cycle()
        into.append((time.perf_counter_ns() - began) * 1e-3)


def _bytes(kind: str) -> tuple[bytes, bytes]:
    """Return what the host sends in a cycle, and what is answered."""
    if kind.startswith("1"):
        answer = packet.build(1, packet.STATUS, bytes(5))
        return packet.read_packet(1, reg.PRESENT_POSITION.address, 4), answer
    fast = "fast" in kind
    goals = Goals(reg.GOAL_CURRENT, IDS).packet()
    question = packet.sync_read_packet(IDS, reg.PRESENT.address, reg.PRESENT.size, fast=fast)
    data = [bytes((one, 0, 3, 0, 0, 0, 0, 8, 0, 0)) for one in IDS]
    if not fast:
        pairs = zip(IDS, data, strict=True)
        answers = [packet.build(one, packet.STATUS, b"\0" + block) for one, block in pairs]
        return goals + question, b"".join(answers)
    length = len(IDS) * (reg.PRESENT.size + 4) + 1
    told = packet.HEADER + bytes((packet.BROADCAST, length, 0, packet.STATUS))
    for one, block in zip(IDS, data, strict=True):
        told += bytes((0, one)) + block
        told += packet.crc16(told).to_bytes(2, "little")
    return goals + question, told


@contextlib.contextmanager
def _responder(question: int, answer: bytes) -> Iterator[tuple[str, int]]:
    """Give the path of a pseudo-terminal behind which a process answers, and one open end of it."""
    master, slave = os.openpty()
    words = [sys.executable, "-S", "-c", RESPONDER, str(master), str(question), answer.hex()]
    with contextlib.ExitStack() as stack:
        stack.callback(os.close, slave)
        try:
            child = subprocess.Popen(words, pass_fds=(master,), stderr=subprocess.DEVNULL)
        finally:
            os.close(master)
        stack.callback(child.wait)
        stack.callback(child.kill)
        path = os.ttyname(slave)
        SerialPort(path, BAUD).close()
        yield path, slave


def _bare(port: int, question: bytes, count: int) -> None:
    """Write the question and read the answer, blocking, and make nothing of it."""
    os.write(port, question)
    while count > 0:
        ready, _, _ = select.select([port], [], [], LIMIT_NS * 1e-9)
        if not ready:
            return
        count -= len(os.read(port, 4096))


def _own_read(path: str) -> tuple[Cycle, Cycle]:
    port = SerialPort(path, BAUD)
    line = OwnLine(port, MonotonicClock(), BAUD)
    return lambda: _read(line), port.close


def _sdk_read(path: str) -> tuple[Cycle, Cycle]:
    port = SerialPort(path, BAUD)
    line = SdkLine(port, MonotonicClock(), BAUD)
    return lambda: _read(line), port.close


def _read(line: Line) -> None:
    line.read(1, reg.PRESENT_POSITION.address, 4)


def _own_sync(path: str) -> tuple[Cycle, Cycle]:
    return _own_cycle(path, fast=False)


def _own_fast(path: str) -> tuple[Cycle, Cycle]:
    return _own_cycle(path, fast=True)


def _sdk_sync(path: str) -> tuple[Cycle, Cycle]:
    return _sdk_cycle(path, fast=False)


def _sdk_fast(path: str) -> tuple[Cycle, Cycle]:
    return _sdk_cycle(path, fast=True)


def _own_cycle(path: str, *, fast: bool) -> tuple[Cycle, Cycle]:
    """Return what the driver does in a cycle: goals from SI, exchange, samples in SI."""
    options = DynamixelOptions.model_validate(
        {
            "port": path,
            "baud": BAUD,
            "watchdog_s": 2.54,  # a stalled machine is no silence to be looked into here
            "read": "fast_sync" if fast else "sync",
            "servos": [{"id": one, "model": "XM430-W350"} for one in IDS],
        }
    )
    axes = tuple(AxisSpec(f"master.a{one}", one, "rotary", "impedance", 1.0) for one in IDS)
    bus = BusSpec("bench", axes, 1000.0)
    clock = MonotonicClock()
    driver = DynamixelDriver(options, bus, clock, None)
    driver.attach(SerialPort(path, BAUD))
    commands = [AxisCommand(0.05, 0.0), AxisCommand(-0.05, 0.0)]

    def cycle() -> None:
        driver.request()
        driver.read(clock.now_ns() + LIMIT_NS)
        driver.write(commands)

    return cycle, driver.detach


def _sdk_cycle(path: str, *, fast: bool) -> tuple[Cycle, Cycle]:
    """Return what the SDK's group classes do in a cycle."""
    sdk: Any = importlib.import_module("dynamixel_sdk")
    port = sdk.PortHandler(path)
    port.openPort()
    port.setBaudRate(BAUD)
    speak = sdk.PacketHandler(2.0)
    goals = sdk.GroupSyncWrite(port, speak, reg.GOAL_CURRENT.address, 2)
    samples = sdk.GroupSyncRead(port, speak, reg.PRESENT.address, reg.PRESENT.size)
    for one in IDS:
        goals.addParam(one, [0, 0])
        samples.addParam(one)
    ask = samples.fastSyncRead if fast else samples.txRxPacket

    def cycle() -> None:
        for one in IDS:
            goals.changeParam(one, [one, 0])
        goals.txPacket()
        ask()
        for one in IDS:
            samples.getData(one, reg.PRESENT_CURRENT.address, 2)
            samples.getData(one, reg.PRESENT_VELOCITY.address, 4)
            samples.getData(one, reg.PRESENT_POSITION.address, 4)

    return cycle, port.closePort
