"""Servos simulated in memory, and a driver in front of them, on the fake clock."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.types import AxisCommand, JointState
from tautwave_drivers.dynamixel import plugin
from tautwave_drivers.dynamixel.driver import DynamixelDriver
from tautwave_drivers.dynamixel.options import DynamixelOptions
from tautwave_sim.dynamixel import simulator
from tests.sim.truths import truth

PERIOD_NS = 1_000_000
XM = "XM430-W350"


class Bench(NamedTuple):
    """A driver and the servos behind it."""

    driver: DynamixelDriver
    world: Any
    clock: FakeClock
    bus: BusSpec

    def enable(self) -> None:
        self.driver.open()
        for _ in range(100):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + PERIOD_NS)
        raise AssertionError("never enabled")

    def cycle(self, *values: float) -> list[JointState]:
        """One period of the loop; `values` are efforts or velocities by the axes' causality."""
        began = self.clock.now_ns()
        self.driver.request()
        states = list(self.driver.read(began + 700_000))
        if values:
            self.driver.write(commands(self.bus, values))
        self.clock.sleep_until(began + PERIOD_NS)
        return states

    def peek(self, index: int, name: str) -> int:
        """What a register of a servo holds."""
        value: int = self.world.servos[index].memory.peek(name)
        return value

    def poke(self, index: int, name: str, value: int) -> None:
        self.world.servos[index].memory.poke(name, value)
        self.world.servos[index]._update_settings()


def commands(bus: BusSpec, values: Sequence[float]) -> list[AxisCommand]:
    return [
        AxisCommand(value, 0.0) if axis.causality == "impedance" else AxisCommand(0.0, value)
        for axis, value in zip(bus.axes, values, strict=True)
    ]


def spec(
    device_id: int, causality: str = "impedance", effort: float = 1.0, velocity: float = 3.0
) -> AxisSpec:
    name = f"master.a{device_id}"
    return AxisSpec(name, device_id, "rotary", causality, effort, velocity, (-3.0, 3.0))


def bus_of(*axes: AxisSpec, **more: Any) -> BusSpec:
    return BusSpec("hand", axes, 1000.0, **more)


def block(*servos: dict[str, Any], **more: Any) -> dict[str, Any]:
    """The options block of a bus, as a rig file has it."""
    return {"port": "sim", "baud": 4_000_000, "servos": list(servos), **more}


def servo(device_id: int, model: str = XM, **more: Any) -> dict[str, Any]:
    return {"id": device_id, "model": model, **more}


def options_of(*servos: dict[str, Any], **more: Any) -> DynamixelOptions:
    options: DynamixelOptions = plugin.options.model_validate(block(*servos, **more))
    return options


def bench(
    *axes: AxisSpec,
    servos: Sequence[dict[str, Any]] | None = None,
    bus: dict[str, Any] | None = None,
    mass: float = 0.5,
    **more: Any,
) -> Bench:
    """A bench of axes; `servos` and `more` as in the options, `bus` of the BusSpec."""
    axes = axes or (spec(1), spec(2))
    given = block(*(servos or [servo(axis.device_id) for axis in axes]), **more)
    options = plugin.options.model_validate(given)
    the_bus = bus_of(*axes, **(bus or {}))
    clock = FakeClock()
    truths = [
        truth(
            mass=mass,
            servo=axis.causality == "admittance" and not axis.takes_position,
            quantum=facts.encoder_quantum,
            effort_quantum=facts.effort_quantum,
            velocity_quantum=facts.velocity_quantum,
        )
        for axis, facts in zip(axes, plugin.facts(options, the_bus), strict=True)
    ]
    world = simulator.make(simulator.options.model_validate(given), the_bus, truths, clock)
    driver = plugin.make(options, the_bus, clock, world.transport)
    assert isinstance(driver, DynamixelDriver)
    return Bench(driver, world, clock, the_bus)
