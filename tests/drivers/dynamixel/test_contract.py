"""The Dynamixel driver keeps the contract of every driver, over simulated servos in memory."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.testing import DriverBench, DriverContract
from tests.drivers.dynamixel.parts import Bench, bench, servo, spec
from tests.drivers.dynamixel.test_foreign import rig
from tests.foreign import servo_line

CASES: dict[str, dict[str, Any]] = {
    "one": {"axes": [spec(1)]},
    "two": {"axes": [spec(1), spec(2)]},
    "fast": {"axes": [spec(1), spec(2)], "read": "fast_sync"},
    "admittance": {"axes": [spec(7, "admittance")]},
    "mixed": {
        "axes": [spec(1), spec(2, "admittance")],
        "servos": [servo(2, "XL330-M288"), servo(1, "XM430-W350", direction=-1, gear_ratio=2.0)],
    },
    "status": {"axes": [spec(1), spec(2)], "status_block": True},
    "unwatched": {
        "axes": [spec(1), spec(2)],
        "simulator": {"servos": {1: {"firmware": 37}}},
        "bus": {"allow_unwatched": True},
    },
    "sdk": {"axes": [spec(1)], "transport": "sdk"},
    "return-delay": {"axes": [spec(1)], "return_delay_s": 20e-6, "usb_latency_s": 0.0},
}


def reported(made: Bench, axis: int) -> float:
    """The last command of the servo, in its own units; a servo without torque has none."""
    made.world.servos[axis]._watch(made.clock.now_ns())
    if not made.world.servos[axis].torque_on:
        return 0.0
    impedance = made.bus.axes[axis].causality == "impedance"
    return float(made.peek(axis, "Goal Current" if impedance else "Goal Velocity"))


def cut(made: Bench) -> None:
    for one in made.world.servos:
        one.present = False


def forget(made: Bench, axis: int, span_ns: int) -> None:
    one = made.world.servos[axis]
    one._reboot_ns = span_ns
    one.reboot(FakeClock.now_ns(made.clock))


def stick(made: Bench, axis: int) -> None:
    memory = made.world.servos[axis].memory
    items_of = memory.items_of

    def stubborn(address: int, data: bytes) -> Any:
        error, items = items_of(address, data)
        return error, [(item, value) for item, value in items if item.name != "Torque Enable"]

    memory.items_of = stubborn


def spoil(made: Bench) -> None:
    made.world.bus._plan.response_fault = lambda device_id, time_s: "wrong_id"


class TestDynamixel(DriverContract):
    @pytest.fixture(params=CASES)
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        case = dict(CASES[request.param])
        made = bench(*case.pop("axes"), **case)
        return DriverBench(
            made.driver,
            made.clock,
            tuple(axis.causality for axis in made.bus.axes),
            lambda axis: reported(made, axis),
            lambda axis: float(made.world.axes[axis].physics.x),
            tuple(axis.name for axis in made.bus.axes),
            lambda: cut(made),
            lambda axis, span_ns: forget(made, axis, span_ns),
            lambda axis: stick(made, axis),
            lambda: spoil(made),
            "of the foreign servos, which the same suite runs before",
        )


class TestForeignDynamixel(DriverContract):
    """The same before servos that share no code with the simulated ones."""

    @pytest.fixture(params=[{}, {"status_block": True}], ids=["plain", "status"])
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        made = rig(**request.param)
        line = made.line

        def commanded(axis: int) -> float:
            line.advance(made.clock.now_ns())
            one = line.servos[axis]
            return float(one.get(servo_line.GOAL_CURRENT, 2, signed=True)) if one.pushes else 0.0

        def shown(axis: int) -> float:
            """Where it was when it was last asked, in its own counts."""
            counts = line.servos[axis].get(servo_line.PRESENT + 6, 4, signed=True)
            return (counts - 2048) / 4096 * math.tau

        def cut() -> None:
            for one in line.servos:
                one.deaf = True

        def stick(axis: int) -> None:
            one = line.servos[axis]
            write = one.write
            one.write = lambda at, data: 0 if at == servo_line.TORQUE else write(at, data)  # type: ignore[method-assign]

        def spoil() -> None:
            line.spoil = lambda frame: servo_line.packet(frame[4] + 9, frame[7:-2])

        def twin() -> None:
            other = servo_line.Servo(9, {servo_line.SHADOW: (1, 1)})
            line.servos = (*line.servos, other)

        return DriverBench(
            made.driver,
            made.clock,
            ("impedance", "impedance"),
            commanded,
            shown,
            ("master.a1", "master.a2"),
            cut,
            lambda axis, span_ns: line.servos[axis].cut_power(made.clock.now_ns(), span_ns),
            stick,
            spoil,
            twin,
        )
