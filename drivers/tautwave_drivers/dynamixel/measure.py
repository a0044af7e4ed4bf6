"""The host's cost of one exchange of two servos over a pseudo-terminal; dynamixel-sdk beside it."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.contracts import CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers.cost import Cycle, Exchange, Made, bench_bus, driver_cycle, measured, timed
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


def measure(cycles: int) -> Sequence[CycleCost]:
    """Measure sync read, fast sync read and a plain read, ours and the SDK's, over the floor.

    Parameters
    ----------
    cycles : int
        Exchanges per figure.
    """
    costs = []
    for kind, ours, theirs, goal in (
        ("2 servos, sync write and sync read", _own_cycle, _sdk_cycle, GOAL_RATIO),
        ("2 servos, sync write and fast sync read", _own_fast, _sdk_fast, GOAL_RATIO),
        ("1 servo, 4 bytes read before the loop", _own_read, _sdk_read, None),
    ):
        what = f"{kind} over a pty"
        spent, floor = measured(bytes_of(kind), ours, cycles)
        costs.append(CycleCost(f"{what}, ours", spent, floor, goal_ratio=goal))
        what = f"{what}, dynamixel-sdk"
        if not _has_sdk():
            costs.append(CycleCost(what, why_not="dynamixel-sdk is not installed"))
            continue
        costs.append(CycleCost(what, *measured(bytes_of(kind), theirs, cycles)))
    return costs


def _has_sdk() -> bool:
    return importlib.util.find_spec("dynamixel_sdk") is not None


def bytes_of(kind: str) -> Exchange:
    """Return request and response of a cycle."""
    if kind.startswith("1"):
        response = packet.build(1, packet.STATUS, bytes(5))
        return Exchange(packet.read_packet(1, reg.PRESENT_POSITION.address, 4), response)
    fast = "fast" in kind
    goals = Goals(reg.GOAL_CURRENT, IDS).packet()
    request = packet.sync_read_packet(IDS, reg.PRESENT.address, reg.PRESENT.size, fast=fast)
    data = [bytes((one, 0, 3, 0, 0, 0, 0, 8, 0, 0)) for one in IDS]
    if not fast:
        pairs = zip(IDS, data, strict=True)
        responses = [packet.build(one, packet.STATUS, b"\0" + block) for one, block in pairs]
        return Exchange(goals + request, b"".join(responses))
    length = len(IDS) * (reg.PRESENT.size + 4) + 1
    joined = packet.HEADER + bytes((packet.BROADCAST, length, 0, packet.STATUS))
    for one, block in zip(IDS, data, strict=True):
        joined += bytes((0, one)) + block
        joined += packet.crc16(joined).to_bytes(2, "little")
    return Exchange(goals + request, joined)


def _own_read(path: str) -> Made:
    port = SerialPort(path, BAUD)
    return _read(PacketLine(port, MonotonicClock(), BAUD)), port.close


def _sdk_read(path: str) -> Made:
    port = SerialPort(path, BAUD)
    return _read(SdkLine(port, MonotonicClock(), BAUD)), port.close


def _read(line: Line) -> Cycle:
    return timed(lambda: line.read(1, reg.PRESENT_POSITION.address, 4))


def _own_fast(path: str) -> Made:
    return _own_cycle(path, read="fast_sync")


def _sdk_fast(path: str) -> Made:
    return _sdk_cycle(path, fast=True)


def _own_cycle(path: str, read: str = "sync") -> Made:
    options = DynamixelOptions.model_validate(
        {
            "port": path,
            "baud": BAUD,
            "watchdog_s": 2.54,  # a stalled machine must not count as silence here
            "read": read,
            "servos": [{"id": one, "model": "XM430-W350"} for one in IDS],
        }
    )
    clock = MonotonicClock()
    driver = DynamixelDriver(options, bench_bus(IDS), clock, None)
    driver.attach(SerialPort(path, BAUD))
    commands = [AxisCommand(0.05, 0.0), AxisCommand(-0.05, 0.0)]
    return driver_cycle(driver, clock, commands), driver.detach


def _sdk_cycle(path: str, *, fast: bool = False) -> Made:
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

    return timed(cycle), port.closePort
