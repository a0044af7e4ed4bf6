"""The host's cost of one exchange of two servos over a pseudo-terminal; dynamixel-sdk beside it."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import AxisSpec, BusSpec, CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.cost import LIMIT_NS, bare_exchange, in_turn, responder_on_pty, timed
from tautwave_drivers.dynamixel.driver import DynamixelDriver
from tautwave_drivers.dynamixel.exchange import Goals
from tautwave_drivers.dynamixel.line.sdk import SdkLine
from tautwave_drivers.dynamixel.line.transactions import Line, PacketLine
from tautwave_drivers.dynamixel.options import DynamixelOptions
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.serial_port import SerialPort

IDS = (1, 2)
BAUD = 4_000_000
GOAL_RATIO = 1.5
Work = Callable[[], None]


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
    make: Callable[[str], tuple[Work, Work]], traffic: tuple[bytes, bytes], cycles: int
) -> tuple[list[float], list[float]]:
    """Return the times of one kind of cycle and of its floor [us]."""
    request, response = traffic
    with responder_on_pty(len(request), response) as (path, end):
        cycle, release = make(path)
        try:
            floor = timed(lambda: bare_exchange(end, request, len(response)))
            return in_turn(cycles, timed(cycle), floor)
        finally:
            release()


def _bytes(kind: str) -> tuple[bytes, bytes]:
    """Return request and response of a cycle."""
    if kind.startswith("1"):
        response = packet.build(1, packet.STATUS, bytes(5))
        return packet.read_packet(1, reg.PRESENT_POSITION.address, 4), response
    fast = "fast" in kind
    goals = Goals(reg.GOAL_CURRENT, IDS).packet()
    request = packet.sync_read_packet(IDS, reg.PRESENT.address, reg.PRESENT.size, fast=fast)
    data = [bytes((one, 0, 3, 0, 0, 0, 0, 8, 0, 0)) for one in IDS]
    if not fast:
        pairs = zip(IDS, data, strict=True)
        responses = [packet.build(one, packet.STATUS, b"\0" + block) for one, block in pairs]
        return goals + request, b"".join(responses)
    length = len(IDS) * (reg.PRESENT.size + 4) + 1
    joined = packet.HEADER + bytes((packet.BROADCAST, length, 0, packet.STATUS))
    for one, block in zip(IDS, data, strict=True):
        joined += bytes((0, one)) + block
        joined += packet.crc16(joined).to_bytes(2, "little")
    return goals + request, joined


def _own_read(path: str) -> tuple[Work, Work]:
    port = SerialPort(path, BAUD)
    line = PacketLine(port, MonotonicClock(), BAUD)
    return lambda: _read(line), port.close


def _sdk_read(path: str) -> tuple[Work, Work]:
    port = SerialPort(path, BAUD)
    line = SdkLine(port, MonotonicClock(), BAUD)
    return lambda: _read(line), port.close


def _read(line: Line) -> None:
    line.read(1, reg.PRESENT_POSITION.address, 4)


def _own_sync(path: str) -> tuple[Work, Work]:
    return _own_cycle(path, fast=False)


def _own_fast(path: str) -> tuple[Work, Work]:
    return _own_cycle(path, fast=True)


def _sdk_sync(path: str) -> tuple[Work, Work]:
    return _sdk_cycle(path, fast=False)


def _sdk_fast(path: str) -> tuple[Work, Work]:
    return _sdk_cycle(path, fast=True)


def _own_cycle(path: str, *, fast: bool) -> tuple[Work, Work]:
    """Return what the driver does in a cycle: goals from SI, exchange, samples in SI."""
    options = DynamixelOptions.model_validate(
        {
            "port": path,
            "baud": BAUD,
            "watchdog_s": 2.54,  # a stalled machine must not count as silence here
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


def _sdk_cycle(path: str, *, fast: bool) -> tuple[Work, Work]:
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
            for item in (reg.PRESENT_CURRENT, reg.PRESENT_VELOCITY, reg.PRESENT_POSITION):
                samples.getData(one, item.address, item.size)

    return cycle, port.closePort
