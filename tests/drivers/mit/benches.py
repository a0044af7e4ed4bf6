"""An MIT driver on the fake clock, in front of simulated motors or of foreign ones."""

from __future__ import annotations

import json
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.contracts import AxisSpec, BusSpec
from tautwave.testing import DriverBench
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.mit import MitDriver, MitOptions, make
from tautwave_sim.mit import simulator
from tests.foreign.mit_motors import ForeignMotor, MotorLine
from tests.sim.truths import truth

PERIOD_NS = 1_000_000
RANGE = (-3.0, 3.0)
FOREIGN = "of the foreign motors, which the same suite runs before"


def motor(number: int, **more: Any) -> dict[str, Any]:
    return {
        "id": number, "feedback_id": number + 16, "p_max": 12.5, "v_max": 30.0, "t_max": 10.0,
        **more,
    }  # fmt: skip


def robstride(number: int, **more: Any) -> dict[str, Any]:
    """Return an RS00, whose host is 0xFD."""
    ranges = {"p_max": 12.57, "v_max": 33.0, "t_max": 14.0}
    return motor(number, feedback_id=0xFD, **{**ranges, **more})


def block(*motors: dict[str, Any], **more: Any) -> dict[str, Any]:
    return {"interface": "virtual", "channel": "test", "motors": list(motors), **more}


def bus_of(
    options: dict[str, Any],
    rate_hz: float = 1000.0,
    position_range: tuple[float, float] = RANGE,
    **more: Any,
) -> BusSpec:
    axes = tuple(
        AxisSpec(
            f"master.a{one['id']}", one["id"], "rotary", "impedance", 1.0, 20.0, position_range
        )
        for one in options["motors"]
    )
    return BusSpec("can", axes, rate_hz, **more)


def driver_options(options: dict[str, Any]) -> MitOptions:
    return MitOptions.model_validate_json(json.dumps(options))


class Rig(NamedTuple):
    """A driver and what is behind it."""

    driver: MitDriver
    clock: FakeClock
    bus: BusSpec
    line: Any
    motors: Any

    def enable(self, limit: int = 1500) -> None:
        for _ in range(limit):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.bus.period_ns)
        raise AssertionError("never enabled")

    def up(self) -> None:
        self.driver.open()
        self.enable()

    def cycle(self, effort: float = 0.0) -> list[JointState]:
        begin = self.clock.now_ns()
        period = self.bus.period_ns
        self.driver.request()
        states = list(self.driver.read(begin + period * 8 // 10))
        self.driver.write([AxisCommand(effort, 0.0)] * len(self.bus.axes))
        self.clock.sleep_until(begin + period)
        return states

    def run(self, cycles: int, effort: float = 0.0) -> tuple[list[list[JointState]], list[Fault]]:
        rows, faults = [], []
        for _ in range(cycles):
            rows.append(self.cycle(effort))
            faults += self.driver.faults()
        return rows, faults


def foreign(
    *motors: dict[str, Any],
    registers: dict[int, float] | None = None,
    mass: float = 1.0,
    rate_hz: float = 1000.0,
    bus: dict[str, Any] | None = None,
    **more: Any,
) -> Rig:
    """A driver in front of foreign motors; `registers` are saved ones of the first."""
    options = block(*motors, **more)
    spec = bus_of(options, rate_hz, **(bus or {}))
    clock = FakeClock()
    behind = [
        ForeignMotor(one["id"], one["feedback_id"], mass, (registers or {}) if not at else {})
        for at, one in enumerate(options["motors"])
    ]
    line = MotorLine(clock, behind)
    return Rig(MitDriver(driver_options(options), spec, clock, line), clock, spec, line, behind)


def simulated(
    *motors: dict[str, Any],
    mass: float = 1.0,
    rate_hz: float = 1000.0,
    bus: dict[str, Any] | None = None,
    **more: Any,
) -> Rig:
    """A driver in front of simulated motors."""
    options = block(*motors, **more)
    spec = bus_of(options, rate_hz, **(bus or {}))
    clock = FakeClock()
    physics = [truth(mass=mass)._replace(period=1.0 / rate_hz) for _ in motors]
    made = simulator.make(
        simulator.options.model_validate_json(json.dumps(options)), spec, physics, clock
    )
    driver: Any = make(driver_options(options), spec, clock, made.transport)
    return Rig(driver, clock, spec, made, made.world.motors)  # type: ignore[attr-defined]


def contract_bench(rig: Rig) -> DriverBench:
    """Return the bench of the suite; what a motor follows is its torque."""
    here = isinstance(rig.line, MotorLine)

    def torque(axis: int) -> float:
        (rig.line if here else rig.line.transport).advance(rig.clock.now_ns())
        one = rig.motors[axis]
        off = one.state != 1 if here else not one.on
        found = float(one.torque)
        # No code is zero: half a step is as much.
        return 0.0 if off or abs(found) < 3e-3 else found

    def place(axis: int) -> float:
        one = rig.motors[axis]
        if not here:
            return float(one.axis.physics.x)
        keys = rig.driver._motors[axis]
        return keys.direction * (one.x - keys.zero)

    def cut() -> None:
        if here:
            rig.line.cut = True
        else:
            for one in rig.motors:
                one.hears = lambda can_id: False

    def stick(axis: int) -> None:
        one = rig.motors[axis]
        hear = one.hear

        def stubborn(can_id: int, data: bytes) -> list[tuple[int, bytes]]:
            """Stay on, whatever it is told, but for its watchdog."""
            if one.state == 1 and data[:7] == bytes((0xFF,) * 7):
                one.fed_ns = one.now_ns
                return one._say()
            return hear(can_id, data)

        one.hear = stubborn

    def spoil() -> None:
        for at, one in enumerate(rig.motors):
            hear = one.hear
            one.hear = lambda can_id, data, hear=hear, at=at: [
                (number, spoilt(answer, at)) for number, answer in hear(can_id, data)
            ]

    def twin() -> None:
        first = rig.motors[0]
        rig.motors.append(ForeignMotor(int(first.saved[8]), 0x55, 1.0, {}))

    more = (
        lambda axis, span_ns: rig.motors[axis].cut_power(FakeClock.now_ns(rig.clock), span_ns),
        stick,
        spoil,
        twin,
    )
    ours = (FOREIGN,) * len(more)
    return DriverBench(
        rig.driver,
        rig.clock,
        tuple("impedance" for _ in rig.bus.axes),
        torque,
        place,
        tuple(axis.name for axis in rig.bus.axes),
        cut,
        *(more if here else ours),
    )


def spoilt(answer: bytes, at: int) -> bytes:
    """Return another's answer: of a motor with another number, or one about a register."""
    if at:
        return bytes((answer[0] ^ 0x04,)) + answer[1:]
    return bytes.fromhex("0100331500004841")
