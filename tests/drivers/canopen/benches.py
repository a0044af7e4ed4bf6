"""A CANopen driver on the fake clock, simulated drives behind it."""

from __future__ import annotations

import json
import struct
from copy import deepcopy
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.testing import DriverBench
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.canopen import CanopenDriver, CanopenOptions, plugin
from tautwave_sim.canopen import simulator
from tautwave_sim.canopen.options import SimulatedCanopenOptions
from tests.sim.truths import truth

PERIOD_NS = 1_000_000
EFFORT_LIMIT = 1.0
FOREIGN = "of the foreign drives, which the same suite runs before"


class Rig(NamedTuple):
    """A driver, its simulated drives, and the log of all frames that the driver sent."""

    driver: CanopenDriver
    clock: FakeClock
    world: Any
    bus: BusSpec
    port: Logged

    @property
    def sent(self) -> list[tuple[int, int, bytes]]:
        return self.port.sent

    def commands(self, axis: int, since: int = 0) -> list[tuple[int, ...]]:
        """Controlword and target of the RPDOs sent to an axis, from a place in `sent` on."""
        number = self.bus.axes[axis].device_id
        kind = "<Hh" if self.bus.axes[axis].causality == "impedance" else "<Hi"
        return [
            struct.unpack_from(kind, data)
            for _, can_id, data in self.sent[since:]
            if can_id == 0x200 + number
        ]

    def devices(self) -> Any:
        return self.world.world.devices

    def open_and_enable(self) -> None:
        self.driver.open()
        self.enable()

    def enable(self, limit: int = 2000) -> None:
        for _ in range(limit):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.bus.period_ns)
        raise AssertionError("never enabled")

    def cycle(self, effort: float = 0.0, velocity: float = 0.0) -> list[JointState]:
        begin = self.clock.now_ns()
        period = self.bus.period_ns
        self.driver.request()
        states = list(self.driver.read(begin + period * 7 // 10))
        self.driver.write([AxisCommand(effort, velocity)] * len(self.bus.axes))
        self.clock.sleep_until(begin + period)
        return states

    def run(self, cycles: int, effort: float = 0.0) -> tuple[list[list[JointState]], list[Fault]]:
        rows, faults = [], []
        for _ in range(cycles):
            rows.append(self.cycle(effort))
            faults += self.driver.faults()
        return rows, faults


def node(number: int, **more: Any) -> dict[str, Any]:
    return {"id": number, "rated_torque": 0.5, "counts_per_revolution": 4096, **more}


def block(*nodes: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"interface": "virtual", "channel": "test", "nodes": list(nodes), **more}


def driver_options(options: dict[str, Any]) -> CanopenOptions:
    return CanopenOptions.model_validate_json(json.dumps(options))


def bus_of(
    options: dict[str, Any],
    causality: tuple[str, ...],
    rate_hz: float = 1000.0,
    **more: Any,
) -> BusSpec:
    axes = tuple(
        AxisSpec(f"master.a{each['id']}", each["id"], "rotary", kind, EFFORT_LIMIT, 50.0)
        for each, kind in zip(options["nodes"], causality, strict=True)
    )
    return BusSpec("can", axes, rate_hz, **more)


class Logged:
    """A frame port that remembers what is sent through it."""

    def __init__(self, port: Any, clock: FakeClock) -> None:
        self._port, self._clock = port, clock
        self.sent: list[tuple[int, int, bytes]] = []
        self.injected: list[tuple[int, bytes]] = []
        self.full = False

    def readable(self) -> bool:
        return bool(self.injected) or bool(self._port.readable())

    def receive(self) -> tuple[int, bytes, int] | None:
        if self.injected:
            can_id, data = self.injected.pop(0)
            return can_id, data, self._clock.now_ns()
        frame: tuple[int, bytes, int] | None = self._port.receive()
        return frame

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)

    def send(self, can_id: int, data: bytes) -> bool:
        if self.full:
            return False
        self.sent.append((self._clock.now_ns(), can_id, bytes(data)))
        return bool(self._port.send(can_id, data))


def make(
    options: dict[str, Any] | None = None,
    causality: tuple[str, ...] = ("impedance", "impedance"),
    *,
    rate_hz: float = 1000.0,
    mass: float = 1e-3,
    **bus_keys: Any,
) -> Rig:
    options = block(node(1), node(2)) if options is None else deepcopy(options)
    clock = FakeClock()
    bus = bus_of(options, causality, rate_hz, **bus_keys)
    parsed = driver_options(options)
    facts = plugin.facts(parsed, bus)
    truths = [
        truth(
            servo=kind == "admittance",
            mass=mass,
            quantum=fact.encoder_quantum,
            effort_quantum=fact.effort_quantum,
            velocity_quantum=fact.velocity_quantum,
            limit=EFFORT_LIMIT,
        )._replace(period=1.0 / rate_hz)
        for kind, fact in zip(causality, facts, strict=True)
    ]
    keys = SimulatedCanopenOptions.model_validate_json(json.dumps(options))
    world: Any = simulator.make(keys, bus, truths, clock)
    port = Logged(world.transport, clock)
    driver = plugin.make(parsed, bus, clock, port)
    assert isinstance(driver, CanopenDriver)
    return Rig(driver, clock, world, bus, port)


def contract_bench(rig: Rig, causality: tuple[str, ...]) -> DriverBench:
    devices = rig.world.world.devices

    def commanded(axis: int) -> float:
        rig.world.advance(rig.clock.now_ns())
        motor = devices[axis].drive.motor
        reported: float = motor.velocity_reported if motor.servo else float(motor.torque_counts)
        return reported

    def cut() -> None:
        for device in devices:
            device.receive = lambda now_ns, can_id, data: None
            device.hears_sync = lambda can_id: False

    return DriverBench(
        rig.driver,
        rig.clock,
        causality,
        commanded,
        lambda axis: rig.world.axes[axis].physics.x,
        tuple(axis.name for axis in rig.bus.axes),
        cut,
        lambda axis, span_ns: devices[axis].power_on(FakeClock.now_ns(rig.clock), span_ns),
        stick=FOREIGN,
        spoil=FOREIGN,
        twin=FOREIGN,
    )
