"""The CANopen driver keeps the contract of every driver, over the simulated drives."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.testing import DriverBench, DriverContract
from tests.drivers.canopen.benches import block, contract_bench, make, node

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
