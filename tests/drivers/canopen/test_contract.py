"""The CANopen driver keeps the contract of every driver, over simulated drives and foreign ones."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.testing import DriverBench, DriverContract
from tests.drivers.canopen.benches import block, contract_bench, make, node
from tests.drivers.canopen.foreign import foreign
from tests.foreign.cia402 import ForeignDrive

CASES: dict[str, tuple[tuple[str, ...], dict[str, Any]]] = {
    "one": (("impedance",), block(node(1))),
    "two": (("impedance", "impedance"), block(node(1), node(2))),
    "mixed": (("impedance", "admittance"), block(node(1), node(2, direction=-1))),
    "lean": (("impedance", "admittance"), block(node(1, mapping="lean"), node(2, mapping="lean"))),
    "event": (("impedance",), block(node(1), rpdo="event")),
    "no sync": (("impedance",), block(node(1), sync=False, rpdo="event")),
    "geared": (("impedance",), block(node(5, gear_ratio=5.2, direction=-1))),
    "quick stop": (("impedance", "admittance"), block(node(1), node(2), stop="quick_stop")),
}


@pytest.fixture(params=list(CASES.values()), ids=list(CASES))
def case(request: pytest.FixtureRequest) -> tuple[tuple[str, ...], dict[str, Any]]:
    return request.param


class TestCanopen(DriverContract):
    forgets_at = 6  # a second each

    @pytest.fixture
    def bench(self, case: tuple[tuple[str, ...], dict[str, Any]]) -> DriverBench:  # type: ignore[override]
        causality, options = case
        return contract_bench(make(options, causality, mass=0.1), causality)


ENCODER = 1 << 16
FINE = {(0x608F, 1): ENCODER}


class TestForeignCanopen(DriverContract):
    """The same before drives that share no code with the simulated ones."""

    forgets_at = 6

    @pytest.fixture(params=[{}, {"rpdo": "event"}], ids=["sync", "event"])
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        fine = {"counts_per_revolution": ENCODER}
        rig = foreign(FINE, first=fine, options=request.param, rate_hz=1e3)
        bus, clock, drives = rig.bus, rig.clock, rig.bus.drives
        drives[0].inertia = 0.1

        def commanded(axis: int) -> float:
            bus.advance(FakeClock.now_ns(clock))
            one = drives[axis]
            return float(one.commanded_torque()) if one.state == "enabled" else 0.0

        def spoil() -> None:
            """Have it send what it did before it was set up: a TPDO of its status alone."""
            for one in drives:
                send = one._send
                one._send = lambda can_id, data, send=send, own=0x180 + one.number: send(
                    can_id, data[:2] if can_id == own else data
                )

        return DriverBench(
            rig.driver,
            clock,
            ("impedance",),
            commanded,
            lambda axis: drives[axis].counts() / ENCODER * math.tau,
            ("master.a1",),
            lambda: setattr(bus, "cut", True),
            lambda axis, span_ns: drives[axis].reboot(bus.now_ns * 1e-9, span_ns * 1e-9),
            lambda axis: setattr(drives[axis], "stubborn", True),
            spoil,
            lambda: drives.append(ForeignDrive(1, bus.late_from_drive)),
        )
