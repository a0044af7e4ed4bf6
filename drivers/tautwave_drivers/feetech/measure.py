"""The host's cost of a cycle of two servos over a pseudo-terminal, for `tautwave bench buses`."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.clock import MonotonicClock
from tautwave.contracts import CycleCost
from tautwave.types import AxisCommand
from tautwave_drivers import protocol1
from tautwave_drivers.cost import Exchange, Made, bench_bus, driver_cycle, measured
from tautwave_drivers.feetech.driver import FeetechDriver
from tautwave_drivers.feetech.exchange import FIELDS
from tautwave_drivers.feetech.options import FeetechOptions, match_servos
from tautwave_drivers.feetech.tables import CYCLE, FULL_TORQUE, HLS
from tautwave_drivers.serial_port import SerialPort

IDS = (1, 2)
BAUD = 1_000_000
GOAL_RATIO = 2.0
EFFORT = 0.05


def measure(cycles: int) -> Sequence[CycleCost]:
    """Measure sync write and sync read of two HLS servos, over the floor.

    Parameters
    ----------
    cycles : int
        Exchanges per figure.
    """
    spent, floor = measured(bytes_of(), _cycle, cycles)
    what = "2 servos, sync write and sync read over a pty"
    return [CycleCost(what, spent, floor, goal_ratio=GOAL_RATIO)]


def bytes_of() -> Exchange:
    """Return request and answers of a cycle."""
    servo = match_servos(_options("bench"), bench_bus(IDS))[0]
    goal = servo.scale(1.0).goal_of(EFFORT, HLS.most)
    size = HLS.goal.size
    pairs = [(one, HLS.goal.encode(goal)) for one in IDS]
    request = protocol1.sync_write_packet(HLS.goal.address, size, pairs)
    request += protocol1.sync_read_packet(IDS, CYCLE.address, CYCLE.size)
    data = FIELDS.pack(1, 0, 0, goal, 0, FULL_TORQUE, 1, 2048, 0, 0, 74, 30, 0, 0, 0)
    answers = [protocol1.build(one, 0, data) for one in IDS]
    return Exchange(request, b"".join(answers))


def _options(path: str) -> FeetechOptions:
    return FeetechOptions.model_validate(
        {
            "port": path,
            "baud": BAUD,
            "power_cut": "no servos",
            "servos": [{"id": one, "model": "HLS3625"} for one in IDS],
        }
    )


def _cycle(path: str) -> Made:
    clock = MonotonicClock()
    driver = FeetechDriver(_options(path), bench_bus(IDS), clock, None)
    driver.attach(SerialPort(path, BAUD))
    commands = [AxisCommand(EFFORT, 0.0)] * len(IDS)
    return driver_cycle(driver, clock, commands), driver.detach
