"""The example driver on the CAN room: moteus, from outside, through the suite and in a run."""

from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path
from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError, DriverError
from tautwave.testing import DriverBench, DriverContract
from tautwave.types import AxisCommand
from tautwave_sim.bench import free_axis

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "tautwave-example-moteus"
CODE = EXAMPLE / "tautwave_example_moteus"
PERIOD_NS = 2_000_000


@pytest.fixture(scope="module", autouse=True)
def package() -> Any:
    """Make the package importable for this module alone."""
    sys.path.insert(0, str(EXAMPLE))
    yield importlib.import_module("tautwave_example_moteus")
    sys.path.remove(str(EXAMPLE))
    for name in [name for name in sys.modules if name.startswith("tautwave_example_moteus")]:
        del sys.modules[name]


def part(name: str) -> Any:
    return importlib.import_module(f"tautwave_example_moteus.{name}")


class Rig:
    """A driver in front of simulated controllers."""

    def __init__(self, *devices: dict[str, Any], **keys: Any) -> None:
        axes = tuple(
            AxisSpec(f"master.a{one['id']}", one["id"], "rotary", "impedance", effort_limit=1.0)
            for one in devices
        )
        self.bus = BusSpec("can", axes, 1e9 / PERIOD_NS)
        self.clock = FakeClock()
        self.options = part("options").Options(
            interface="virtual", channel="test", devices=devices, **keys
        )
        truths = [free_axis(PERIOD_NS * 1e-9, 1.0, 0.1, seed=(0, axis.device_id)) for axis in axes]
        self.devices = part("fake").Bus(self.options, self.bus, truths, self.clock)
        self.driver = part("driver").MoteusDriver(self.options, self.bus, self.clock, self.devices)

    def enable(self) -> None:
        self.driver.open()
        for _ in range(20):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + PERIOD_NS)
        raise AssertionError

    def cycle(self, effort: float) -> list[Any]:
        until = self.clock.now_ns() + PERIOD_NS
        self.driver.request()
        states = list(self.driver.read(until))
        self.driver.write([AxisCommand(effort, 0.0)] * len(self.bus.axes))
        self.clock.sleep_until(until)
        return states

    def acting(self, axis: int) -> float:
        self.devices.advance(self.clock.now_ns())
        one = self.devices.controllers[axis]
        return one.direction * (one.torque if one.mode == 10 else 0.0)


class TestMoteus(DriverContract):
    @pytest.fixture(params=["two", "turned"])
    def bench(self, request: pytest.FixtureRequest) -> DriverBench:  # type: ignore[override]
        turned = {"direction": -1, "zero": 0.5} if request.param == "turned" else {}
        rig = Rig({"id": 1}, {"id": 9, **turned})  # 9 answers with an identifier of 29 bits
        return DriverBench(
            rig.driver,
            rig.clock,
            ("impedance", "impedance"),
            rig.acting,
            lambda axis: rig.devices.axes[axis].physics.x,
            names=("master.a1", "master.a9"),
            cut=lambda: setattr(rig.devices, "cut", True),
            forget=rig.devices.forget,
            stick=lambda axis: setattr(rig.devices.controllers[axis], "stuck", True),
            spoil=lambda: setattr(rig.devices, "spoiled", True),
            twin="two controllers of one id answer alike: only the bus' error frames would tell",
            period_ns=PERIOD_NS,
        )


def test_the_package_is_as_small_as_it_says() -> None:
    lines = {path.name: len(path.read_text().splitlines()) for path in CODE.glob("*.py")}
    fake = lines.pop("fake.py")
    assert sum(lines.values()) <= 600
    assert fake <= 300


def test_a_command_is_the_reference_s_registers() -> None:
    """By hand: a write of modes and floats as moteus' reference has them, in 32 bytes."""
    frames = part("frames")
    assert frames.padded(frames.STATE + frames.STOP) == bytes.fromhex("11001f01130d010000505050")
    data = frames.command(0.1, 0.05)
    assert len(data) == 29
    assert bytes.fromhex("0d22cdcccc3d") in data  # 0.1 N m, register 022
    assert bytes.fromhex("0d27cdcc4c3d") in data  # 0.05 s, register 027
    assert data.index(bytes((0x01, 0x00, 10))) < data.index(bytes((0x02, 0x20, 0x80, 0x00)))
    assert frames.request_id(1) == 0x80008001
    assert frames.answer_id(1) == 0x100
    assert frames.answer_id(9) == 0x80000900


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("21000a2f010000003f000000bf0000803e230d300a00505050", {0: 10, 1: 0.5, 2: -0.5, 3: 0.25}),
        ("310001", None),
        ("2f01000000", None),
        ("", {}),
        ("2080", None),
    ],
)
def test_answers_are_read_or_are_none(data: str, said: dict[int, float] | None) -> None:
    found = part("frames").parsed(bytes.fromhex(data))
    if said is None:
        assert found is None
    else:
        assert {key: found[key] for key in said} == said


def test_random_bytes_never_raise() -> None:
    import random

    draws = random.Random(1)
    for _ in range(5000):
        part("frames").parsed(draws.randbytes(draws.randrange(65)))


def test_an_unknown_register_map_is_refused() -> None:
    rig = Rig({"id": 1})
    rig.devices.controllers[0].map_version = 4
    with pytest.raises(DriverError, match="has map 4; this driver knows 5"):
        rig.driver.open()


def test_a_watchdog_that_is_not_taken_is_refused_before_torque() -> None:
    rig = Rig({"id": 1}, watchdog_s=0.05)
    rig.devices.controllers[0].deaf_to_watchdog = True
    with pytest.raises(DriverError, match=r"watchdog 0.1 s, not 0.05"):
        rig.enable()
    rig.driver.close()
    assert rig.acting(0) == 0.0


def test_a_silent_controller_is_named_with_what_to_check() -> None:
    rig = Rig({"id": 1}, {"id": 2})
    rig.devices.forget(1, 10**12)
    with pytest.raises(DriverError, match=r"master.a2: controller 2 does not answer; check"):
        rig.driver.open()


def test_a_fault_in_a_run_names_its_cause_and_stops_its_axis() -> None:
    rig = Rig({"id": 1}, {"id": 2})
    rig.enable()
    rig.cycle(0.5)
    rig.devices.controllers[1].fail(38)
    for _ in range(3):
        states = rig.cycle(0.5)
    (fault,) = [one for one in rig.driver.faults() if one.fatal]
    assert fault.text.startswith("master.a2: fault: over temperature; its torque is off")
    assert states[0].valid
    assert not states[1].valid
    rig.driver.close()


@pytest.mark.parametrize("effort", [math.nan, math.inf, -math.inf, 7.0])
def test_no_command_is_beyond_the_limit_or_no_number(effort: float) -> None:
    rig = Rig({"id": 1})
    rig.enable()
    for _ in range(3):
        rig.cycle(effort)
    wanted = 0.0 if math.isnan(effort) else math.copysign(1.0, effort)
    assert rig.acting(0) == wanted
    rig.driver.close()


def test_options_say_what_is_wrong() -> None:
    with pytest.raises(ConfigError, match=r"watchdog_s is below 3 periods; use 0\.006"):
        Rig({"id": 1}, watchdog_s=0.002)


def test_its_bus_time_is_that_of_the_frames_it_sends() -> None:
    rig = Rig(*({"id": number} for number in range(1, 8)))
    found = part("options").budget(rig.options, rig.bus)
    assert found.time_s == pytest.approx(1.72e-3, rel=0.03)  # seven, as the lengths say
    sent = []
    rig.enable()
    send = rig.devices.send
    rig.devices.send = lambda can_id, data: sent.append(len(data)) or send(can_id, data)
    rig.cycle(0.1)
    assert sent == [part("frames").REQUEST_SIZE] * 7
    rig.driver.close()
