"""Modbus drives simulated in memory, and a driver in front of them, on the fake clock."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.driver import ModbusDriver
from tautwave_sim.modbus import simulator
from tests.sim.truths import truth

RATE_HZ = 1000.0
RATED = {"generic": 1.0, "dsy-rs": 1.27, "cia402": 1.0}
FAST_RTU: dict[str, Any] = {
    "link": "rtu",
    "baud": 4_000_000,
    "gap_s": 1e-5,
    "late_s": 5e-4,
    "simulator": {"silent_s": 1e-5},
}
"""A line that is fast enough for the 1 kHz of the contract suite."""


class Bench(NamedTuple):
    """A driver and the drives behind it."""

    driver: ModbusDriver
    world: Any
    clock: FakeClock
    bus: BusSpec

    def enable(self) -> None:
        self.driver.open()
        for _ in range(5000):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.bus.period_ns)
        raise AssertionError("never enabled")

    def cycle(self, *values: float) -> list[JointState]:
        """One period of the loop; `values` are efforts or velocities by the axes' causality."""
        began = self.clock.now_ns()
        self.driver.request()
        states = list(self.driver.read(began + self.bus.period_ns * 7 // 10))
        if values:
            self.driver.write(commands(self.bus, values))
        self.clock.sleep_until(began + self.bus.period_ns)
        return states

    def run(self, cycles: int, value: float = 0.0) -> list[list[JointState]]:
        count = len(self.bus.axes)
        return [self.cycle(*[value] * count) for _ in range(cycles)]

    def faults(self) -> list[Fault]:
        return list(self.driver.faults())

    def number(self, unit: int, name: str) -> int:
        """What a register of a drive holds."""
        value: int = self.world.bus.drives[unit].bank.number(name)
        return value

    def commanded(self, axis: int) -> float:
        """What the motor of an axis follows [counts]."""
        drive = self.world.bus.drives[self.bus.axes[axis].device_id]
        drive.settle(self.clock.now_ns())
        return float(drive.motor.setpoint if drive.on else 0.0)


def commands(bus: BusSpec, values: Sequence[float]) -> list[AxisCommand]:
    return [
        AxisCommand(value, 0.0) if axis.causality == "impedance" else AxisCommand(0.0, value)
        for axis, value in zip(bus.axes, values, strict=True)
    ]


def spec(
    unit: int, causality: str = "impedance", effort: float = 1.0, velocity: float = 3.0
) -> AxisSpec:
    return AxisSpec(f"slave.a{unit}", unit, "rotary", causality, effort, velocity, (-3.0, 3.0))


def device(unit: int, profile: str = "generic", **more: Any) -> dict[str, Any]:
    return {"unit": unit, "profile": profile, "rated_torque": RATED[profile], **more}


def queued(folder: Path, outstanding: int, units: int) -> list[dict[str, Any]]:
    """Devices of the generic profile behind a server that takes so many requests at once."""
    text = files("tautwave_drivers.modbus").joinpath("profiles/generic.yaml").read_text("utf-8")
    assert "\noutstanding: 1\n" in text
    path = folder / f"queue-{outstanding}.yaml"
    path.write_text(text.replace("\noutstanding: 1\n", f"\noutstanding: {outstanding}\n"))
    return [device(unit) | {"profile": str(path)} for unit in range(1, units + 1)]


def options_of(axes: Sequence[AxisSpec], profile: str, **more: Any) -> dict[str, Any]:
    """The options block of a bus, as a rig file has it."""
    block: dict[str, Any] = {"endpoint": "sim", "turnaround_s": 0.0}
    block["devices"] = [device(axis.device_id, profile) for axis in axes]
    return {**block, **more}


def bus_of(axes: Sequence[AxisSpec], rate_hz: float = RATE_HZ, **more: Any) -> BusSpec:
    return BusSpec("arm", tuple(axes), rate_hz, **{"allow_unwatched": True, **more})


def bench(
    *axes: AxisSpec,
    profile: str = "generic",
    rate_hz: float = RATE_HZ,
    bus: dict[str, Any] | None = None,
    mass: float = 0.5,
    **more: Any,
) -> Bench:
    axes = axes or (spec(1),)
    made = bus_of(axes, rate_hz, **(bus or {}))
    block = options_of(axes, profile, **more)
    clock = FakeClock(1_000_000_000)
    truths = [
        truth(mass=mass, servo=axis.causality == "admittance")._replace(period=1.0 / rate_hz)
        for axis in axes
    ]
    world = simulator.make(simulator.options.model_validate_json(_json(block)), made, truths, clock)
    driver = plugin.make(plugin.options.model_validate(block), made, clock, world.transport)
    assert isinstance(driver, ModbusDriver)
    return Bench(driver, world, clock, made)


def _json(block: dict[str, Any]) -> str:
    import json

    return json.dumps(block)
