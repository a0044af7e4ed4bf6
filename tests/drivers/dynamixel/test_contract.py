"""The Dynamixel driver keeps the contract of every driver, over simulated servos in memory."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.testing import DriverBench, DriverContract
from tests.drivers.dynamixel.parts import Bench, bench, servo, spec

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
        )
