"""The Modbus driver keeps the contract of every driver, over simulated drives in memory."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.testing import DriverBench, DriverContract
from tautwave_sim.modbus.faults import UNDISTURBED
from tests.drivers.modbus.parts import FAST_RTU, Bench, bench, device, spec
from tests.drivers.modbus.test_foreign import rig
from tests.foreign.modbus_drive import TORQUE, Drive, crc16

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

ONE_SERVER = (
    "a connection reaches one server, which gives one answer to a request, also where it is a "
    "gateway with two drives behind it"
)


def cut(made: Bench) -> None:
    made.world.bus.plan.request = lambda unit, t_ns: UNDISTURBED._replace(lost=True)


def forget(made: Bench, axis: int, span_ns: int) -> None:
    """Cut the power of a drive for a while: it is not heard, and begins anew."""
    unit, now = made.bus.axes[axis].device_id, FakeClock.now_ns
    until = now(made.clock) + span_ns
    made.world.bus.drives[unit].inject("power_cycle", None)
    plan = made.world.bus.plan
    request = type(plan).request

    def answer(which: int, t_ns: int | None) -> Any:
        if which == unit and now(made.clock) < until:
            return UNDISTURBED._replace(lost=True)
        return request(plan, which, t_ns)

    plan.request = answer


def stick(made: Bench, axis: int) -> None:
    drive = made.world.bus.drives[made.bus.axes[axis].device_id]
    drive.machine.on_write = lambda fresh, now_ns: None


def spoil(made: Bench) -> None:
    made.world.bus.plan.request = lambda unit, t_ns: UNDISTURBED._replace(wrong_unit=True)


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
            lambda axis, span_ns: forget(made, axis, span_ns),
            lambda axis: stick(made, axis),
            lambda: spoil(made),
            "of the foreign drives on a serial line",
        )


class TestForeignModbus(DriverContract):
    """The same before drives that share no code with the simulated ones."""

    @pytest.fixture(params=[True, False], ids=["tcp", "rtu"])
    def bench(  # type: ignore[override]
        self, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
    ) -> DriverBench:
        fast = {} if request.param else {"baud": 4_000_000, "gap_s": 1e-5, "late_s": 5e-4}
        drives = [Drive(), Drive()] if request.param else [Drive()]  # a line is slower
        both = (3, 6, 16, 23)
        made = rig(monkeypatch, *drives, tcp=request.param, rate_hz=1e3, functions=both, **fast)
        line = made.line

        def drive(axis: int) -> Drive:
            one = line.drives[axis + 1]
            one.advance(made.clock.now_ns())
            return one

        def spoil() -> None:
            if request.param:
                line.spoil = lambda frame: frame[:6] + bytes((frame[6] + 7,)) + frame[7:]
            else:
                line.spoil = lambda frame: again(bytes((frame[0] + 7,)) + frame[1:-2])

        def again(body: bytes) -> bytes:
            return body + crc16(body)

        return DriverBench(
            made.driver,
            made.clock,
            ("impedance",) * len(drives),
            lambda axis: float(drive(axis).words[TORQUE]) if drive(axis).on else 0.0,
            lambda axis: drive(axis).shown,
            ("slave.a1", "slave.a2")[: len(drives)],
            lambda: setattr(line, "cut", True),
            lambda axis, span_ns: drive(axis).cut_power(FakeClock.now_ns(made.clock), span_ns),
            lambda axis: setattr(drive(axis), "stubborn", 10**6),
            spoil,
            ONE_SERVER if request.param else lambda: setattr(line, "twin", Drive()),
        )
