"""The Feetech driver keeps the contract of every driver: over foreign servos and simulated ones."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tautwave.testing import DriverBench, DriverContract
from tests.drivers.feetech.benches import Rig, contract_bench, foreign, servo, simulated

ECHO = {"echo": True}

CASES: dict[str, Callable[[], Rig]] = {
    "current": lambda: foreign(servo(1), servo(2)),
    "both, turned": lambda: foreign(servo(3, "STS"), servo(4, direction=-1, zero_counts=2200)),
    "simulated current": lambda: simulated(servo(1), servo(2, direction=-1), simulator=ECHO),
    "simulated voltage": lambda: simulated(servo(1, "STS", gear=147.0), servo(2, "STS")),
}


class TestFeetech(DriverContract):
    @pytest.fixture(params=CASES)
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:
        return contract_bench(CASES[request.param]())
