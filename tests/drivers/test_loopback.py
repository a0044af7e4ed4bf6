"""The loopback driver keeps the contract."""

from __future__ import annotations

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.testing import DriverBench, DriverContract
from tautwave_sim.loopback import LoopbackDriver, LoopbackOptions, LoopbackSimulator, plugin
from tests.sim.truths import truth

APART = "its axes are objects of this process: they have no power, no line and no answers of theirs"


def make(*causality: str, delay_s: float = 0.0) -> DriverBench:
    clock = FakeClock()
    specs = [AxisSpec(f"master.a{n}", n, "linear", kind, 10.0) for n, kind in enumerate(causality)]
    world = LoopbackSimulator(
        specs, [truth(servo=kind == "admittance", delay=delay_s / 1e-3) for kind in causality]
    )
    bus = BusSpec("bench", tuple(specs), 1000.0)
    driver = LoopbackDriver(LoopbackOptions(command_delay_s=delay_s), bus, clock, world)
    return DriverBench(
        driver,
        clock,
        causality,
        lambda axis: world.axes[axis]._command,
        lambda axis: world.axes[axis].physics.x,
        forget=APART,
        stick=APART,
        spoil=APART,
        twin=APART,
    )


CASES = [
    (("impedance",), 0.0), (("impedance", "impedance"), 0.0),
    (("impedance", "admittance"), 0.0), (("impedance",), 2e-3), (("admittance",), 1.5e-3),
]  # fmt: skip


@pytest.fixture(params=CASES, ids=["one", "two", "mixed", "delayed", "remainder"])
def case(request: pytest.FixtureRequest) -> tuple[tuple[str, ...], float]:
    return request.param


class TestLoopback(DriverContract):
    @pytest.fixture
    def bench(self, case: tuple[tuple[str, ...], float]) -> DriverBench:  # type: ignore[override]
        return make(*case[0], delay_s=case[1])


def test_the_plugin_has_no_hardware_and_no_bus_time() -> None:
    assert not plugin.hardware
    assert plugin.budget(LoopbackOptions(), BusSpec("bench", (), 1000.0)).time_s == 0.0
    assert plugin.scan(LoopbackOptions()) == ()
