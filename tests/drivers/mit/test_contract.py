"""The MIT driver keeps the contract of every driver: over foreign motors and simulated ones."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tautwave.testing import DriverBench, DriverContract
from tests.drivers.mit.benches import Rig, contract_bench, foreign, motor, robstride, simulated

CASES: dict[str, Callable[[], Rig]] = {
    "foreign": lambda: foreign(motor(1), motor(2)),
    "foreign turned": lambda: foreign(motor(3, direction=-1, zero=0.25)),
    "simulated": lambda: simulated(motor(1), motor(2)),
    "simulated turned": lambda: simulated(motor(1), motor(2, direction=-1, zero=0.5)),
    "fd": lambda: simulated(motor(1), motor(2), data_bitrate=5_000_000),
    "unwatched": lambda: simulated(
        motor(1),
        motor(2),
        bus={"allow_unwatched": True},
        simulator={"motors": {"2": {"ignores_timeout": True}}},
    ),
    "robstride": lambda: simulated(robstride(1), robstride(2), family="robstride"),
    "robstride turned": lambda: simulated(
        robstride(1),
        robstride(2, direction=-1, zero=0.5),
        family="robstride",
        bus={"allow_unwatched": True},
        simulator={"motors": {"2": {"ignores_timeout": True}}},
    ),
}


class TestMit(DriverContract):
    @pytest.fixture(params=CASES)
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        return contract_bench(CASES[request.param]())
