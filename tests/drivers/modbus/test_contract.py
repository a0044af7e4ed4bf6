"""The Modbus driver keeps the contract of every driver, over simulated drives in memory."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.testing import DriverBench, DriverContract
from tautwave_sim.modbus.faults import UNDISTURBED
from tests.drivers.modbus.parts import FAST_RTU, Bench, bench, device, spec

CASES: dict[str, dict[str, Any]] = {
    "one": {"axes": [spec(1)]},
    "two": {"axes": [spec(1), spec(2)]},
    "own-endpoints": {
        "axes": [spec(1), spec(2)],
        "devices": [device(1), device(2, endpoint="tcp://other:502")],
    },
    "write-then-read": {"axes": [spec(1)], "devices": [device(1, function_codes=[3, 6])]},
    "admittance": {"axes": [spec(7, "admittance")]},
    "mixed": {
        "axes": [spec(1), spec(2, "admittance")],
        "devices": [device(2, "cia402"), device(1, direction=-1, gear_ratio=2.0)],
    },
    "dsy-rs": {"axes": [spec(1)], "profile": "dsy-rs"},
    "cia402": {"axes": [spec(1)], "profile": "cia402"},
    "rtu": {"axes": [spec(1)], **FAST_RTU},
    "rtu-two": {"axes": [spec(1), spec(2, "admittance")], **FAST_RTU},
    "rtu-dsy-rs": {"axes": [spec(1)], "profile": "dsy-rs", **FAST_RTU},
    "rtu-cia402": {"axes": [spec(1)], "profile": "cia402", **FAST_RTU},
}


def cut(made: Bench) -> None:
    made.world.bus.plan.request = lambda unit, t_ns: UNDISTURBED._replace(lost=True)


class TestModbus(DriverContract):
    @pytest.fixture(params=CASES)
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        case = dict(CASES[request.param])
        made = bench(*case.pop("axes"), **case)
        return DriverBench(
            made.driver,
            made.clock,
            tuple(axis.causality for axis in made.bus.axes),
            made.commanded,
            lambda axis: float(made.world.axes[axis].physics.x),
            tuple(axis.name for axis in made.bus.axes),
            lambda: cut(made),
        )
