"""A Feetech driver on the fake clock, in front of foreign servos or of simulated ones."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.testing import DriverBench
from tautwave.truth import PositionLoop
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.feetech import FeetechDriver, FeetechOptions
from tautwave_sim.feetech import simulator
from tests.foreign.feetech_line import Line, Servo, frame
from tests.sim.truths import truth

RANGE = (-2.0, 2.0)
CUT = "switch on the supply"
MODELS = {"STS": "STS3215", "HLS": "HLS3625"}


def block(*servos: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"port": "bench", "servos": list(servos), "power_cut": CUT, "usb_latency_s": 0.0, **more}


def servo(number: int, kind: str = "HLS", **more: Any) -> dict[str, Any]:
    return {"id": number, "model": MODELS[kind], **more}


def bus_of(options: dict[str, Any], rate_hz: float = 1000.0, **more: Any) -> BusSpec:
    follows = more.pop("follows", ())
    axes = tuple(
        AxisSpec(
            f"master.a{one['id']}", one["id"], "rotary",
            "admittance" if one["id"] in follows else "impedance", 1.0, 20.0, RANGE,
            takes_position=one["id"] in follows,
        )
        for one in options["servos"]
    )  # fmt: skip
    more.setdefault("allow_unwatched", True)
    return BusSpec("servos", axes, rate_hz, **more)


def driver_options(options: dict[str, Any]) -> FeetechOptions:
    return FeetechOptions.model_validate_json(json.dumps(options))


class Rig(NamedTuple):
    """A driver and what is behind it."""

    driver: FeetechDriver
    clock: FakeClock
    bus: BusSpec
    line: Any
    servos: Any

    def enable(self, limit: int = 500) -> None:
        for _ in range(limit):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.bus.period_ns)
        raise AssertionError("never enabled")

    def up(self) -> None:
        self.driver.open()
        self.enable()

    def cycle(self, effort: float = 0.0, position: float = float("nan")) -> list[JointState]:
        begin = self.clock.now_ns()
        period = self.bus.period_ns
        self.driver.request()
        states = list(self.driver.read(begin + period * 8 // 10))
        self.driver.write([AxisCommand(effort, 0.0, position)] * len(self.bus.axes))
        self.clock.sleep_until(begin + period)
        return states

    def run(
        self, cycles: int, effort: float = 0.0, position: float = float("nan")
    ) -> tuple[list[list[JointState]], list[Fault]]:
        rows: list[list[JointState]] = []
        faults: list[Fault] = []
        for _ in range(cycles):
            rows.append(self.cycle(effort, position))
            faults += self.driver.faults()
        return rows, faults


def foreign(
    *servos: dict[str, Any],
    registers: dict[int, int] | None = None,
    mass: float = 0.3,
    rate_hz: float = 500.0,
    bus: dict[str, Any] | None = None,
    **more: Any,
) -> Rig:
    """A driver in front of foreign servos; `registers` are saved ones of the first."""
    options = block(*servos, **more)
    spec = bus_of(options, rate_hz, **(bus or {}))
    clock = FakeClock()
    kinds = {model: kind for kind, model in MODELS.items()}
    behind = [
        Servo(one["id"], kinds[one["model"]], mass, (registers or {}) if not at else {})
        for at, one in enumerate(options["servos"])
    ]
    line = Line(clock, *behind)
    return Rig(FeetechDriver(driver_options(options), spec, clock, line), clock, spec, line, behind)


def simulated(
    *servos: dict[str, Any],
    mass: float = 0.3,
    rate_hz: float = 500.0,
    bus: dict[str, Any] | None = None,
    viscous: float = 0.0,
    **more: Any,
) -> Rig:
    """A driver in front of simulated servos."""
    options = block(*servos, **more)
    spec = bus_of(options, rate_hz, **(bus or {}))
    clock = FakeClock()
    one = truth(mass=mass, viscous=viscous)._replace(period=1.0 / rate_hz)
    physics = [
        one._replace(loop=PositionLoop(40.0, 10.0)) if axis.takes_position else one
        for axis in spec.axes
    ]
    made = simulator.make(
        simulator.options.model_validate_json(json.dumps(options)), spec, physics, clock
    )
    driver = FeetechDriver(driver_options(options), spec, clock, made.transport)
    return Rig(driver, clock, spec, made, made.servos)  # type: ignore[attr-defined]


def contract_bench(rig: Rig) -> DriverBench:
    """Return the bench of the suite; what a servo follows is its motor's effort."""

    if not isinstance(rig.line, Line):
        return _simulated_bench(rig)

    def effort(axis: int) -> float:
        rig.line.advance(rig.clock.now_ns())
        one = rig.servos[axis]
        follows = rig.bus.axes[axis].takes_position
        return float(one.memory[40] == 1) if follows else float(one.effort)

    def place(axis: int) -> float:
        keys = rig.driver._servos[axis].options
        found = rig.servos[axis].x + (2048 - keys.zero_counts) * 2 * 3.141592653589793 / 4096
        return float(keys.direction * found)

    def cut() -> None:
        rig.line.cut = True

    def stick(axis: int) -> None:
        rig.servos[axis].stubborn = True

    def spoil() -> None:
        def another(answer: bytes) -> bytes:
            return frame(answer[2] + 40, answer[4], answer[5:-1])

        rig.line.spoil = another

    def twin() -> None:
        first = rig.servos[0]
        rig.line.servos.append(Servo(first.device, first.kind, registers={7: 50}))

    return DriverBench(
        rig.driver,
        rig.clock,
        tuple(axis.causality for axis in rig.bus.axes),
        effort,
        place,
        tuple(axis.name for axis in rig.bus.axes),
        cut,
        lambda axis, span_ns: rig.servos[axis].cut_power(FakeClock.now_ns(rig.clock), span_ns),
        stick,
        spoil,
        twin,
        rig.bus.period_ns,
    )


def _simulated_bench(rig: Rig) -> DriverBench:
    def effort(axis: int) -> float:
        rig.line.advance(rig.clock.now_ns())
        one = rig.servos[axis]
        follows = rig.bus.axes[axis].takes_position
        return float(one.torque_on) if follows else float(one.effort)

    def place(axis: int) -> float:
        return float(rig.servos[axis].axis.physics.x)

    def cut() -> None:
        for one in rig.servos:
            one.hears = lambda baud, now_ns: False

    def forget(axis: int, span_ns: int) -> None:
        one = rig.servos[axis]
        one.quirks = one.quirks.model_copy(update={"boot_s": span_ns * 1e-9})
        one.restart(FakeClock.now_ns(rig.clock))

    def stick(axis: int) -> None:
        one = rig.servos[axis]
        one.quirks = one.quirks.model_copy(update={"stuck": [40]})

    def spoil() -> None:
        bus = rig.line.bus
        respond = bus._respond
        bus._respond = lambda one, number, *rest: respond(one, number + 40, *rest)

    return DriverBench(
        rig.driver,
        rig.clock,
        tuple(axis.causality for axis in rig.bus.axes),
        effort,
        place,
        tuple(axis.name for axis in rig.bus.axes),
        cut,
        forget,
        stick,
        spoil,
        "of the foreign servos, which the same suite runs before",
        rig.bus.period_ns,
    )
