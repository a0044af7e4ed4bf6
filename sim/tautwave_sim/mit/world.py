"""Simulated MIT motors on one CAN bus: its wire, its motors, and the slots that they move on.

A slot begins with the first command of a cycle: all axes move to it, are measured there, and what
each motor is commanded in that cycle acts from then on. The commands of a cycle follow one another
on the wire; each motor's place in it is learnt in the first. The slots begin with the first command
after all motors are enabled; until then the axes are held. Where no command comes, the axes move on
half a period late, so that a watchdog that trips is felt.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from tautwave.contracts import BusSpec
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis, join_arms
from tautwave_sim.mit.body import Body
from tautwave_sim.mit.motor import Motor
from tautwave_sim.mit.options import Quirks, SimulatedMitOptions
from tautwave_sim.mit.robstride import RobstrideMotor
from tautwave_sim.wire.can_medium import MediumPort
from tautwave_sim.wire.can_world import CanWorld, Planned, earlier, listed, wire_of


class MotorBus(CanWorld):
    """A CAN bus with motors on it.

    Parameters
    ----------
    options : SimulatedMitOptions
        The bus and its motors.
    bus : BusSpec
        Axes and rate.
    truths : sequence of AxisModel
        One per axis.
    now_ns : int
        When everything is switched on.
    """

    def __init__(
        self,
        options: SimulatedMitOptions,
        bus: BusSpec,
        truths: Sequence[AxisModel],
        now_ns: int,
    ) -> None:
        timing, plan = wire_of(options, truths)
        super().__init__(timing, plan, bus.period_ns, now_ns)
        self.extended = options.family == "robstride"
        self._free = options.simulator.free
        self.motors: list[Body] = []
        self.axes: list[SimulatedAxis] = []
        self._phases: dict[int, int] = {}
        self._ports: list[MediumPort] = []
        self._trip_ns: int | None = None
        known = listed(bus, "motors", {motor.id: motor for motor in options.motors})
        for spec, keys, truth in zip(bus.axes, known, truths, strict=True):
            at = len(self.motors)
            port = self.medium.port(partial(self._hear, at))
            self._ports.append(port)
            quirks = options.simulator.motors.get(spec.device_id, Quirks())
            motor: Body = (
                RobstrideMotor(keys, quirks, spec.name, truth, port.send)
                if self.extended
                else Motor(keys, quirks, spec.name, truth, timing.fd, port.send)
            )
            self.motors.append(motor)
            self.axes.append(motor.axis)
            motor.free = motor.axis.in_hand
            self._befalls(at, _planned_faults(motor, quirks))
        self.arms = join_arms(self.axes, truths)
        self._look()

    # -- events ---------------------------------------------------------------------------

    def _device_event_ns(self) -> int | None:
        if self._stale:
            self._look()
        return earlier(self._tick_ns(), self._trip_ns)

    def _look(self) -> None:
        """Look at every motor: when a watchdog trips, and what it hears."""
        self._stale, self._trip_ns = False, None
        for motor, port in zip(self.motors, self._ports, strict=True):
            self._trip_ns = earlier(self._trip_ns, motor.next_event_ns())
            port.ids = motor.ids()

    def _tick_ns(self) -> int | None:
        """Return when the next slot begins if no command does it."""
        if self._origin_ns is None:
            return None
        late = 0 if self._free else self._period_ns // 2
        return self._origin_ns + (self._slot + 1) * self._period_ns + late

    def _run(self, at_ns: int) -> None:
        tick_ns = self._tick_ns()
        if tick_ns is not None and tick_ns <= at_ns:
            self._pass_to(self._slot + 1)
        for motor in self.motors:
            motor.run(at_ns)
        self._stale = True

    # -- slots ----------------------------------------------------------------------------

    def _pass_to(self, slot: int) -> None:
        while self._slot < slot:
            self._slot += 1
            for motor in self.motors:
                motor.pass_slot()
            for motor in self.motors:
                motor.settle()

    def _hear(self, at: int, now_ns: int, can_id: int, data: bytes) -> None:
        motor = self.motors[at]
        if not motor.hears(can_id):
            return
        commanded = motor.commands(can_id, data)
        if commanded:
            self._slot_of(at, now_ns)
        # A command puts a watchdog off, which is seen when it was due; all else may bring it on.
        self._stale = self._stale or not commanded or motor.heard_ns is None
        motor.receive(now_ns, can_id, data)
        if self._free and self._origin_ns is None and motor.on:
            self._begin(now_ns)

    def _slot_of(self, at: int, now_ns: int) -> None:
        """Bring all axes to the slot of a command."""
        if self._origin_ns is None:
            if not all(motor.on for motor in self.motors):
                return
            self._begin(now_ns)
        assert self._origin_ns is not None
        since = now_ns - self._origin_ns
        phase = 0 if self._free else self._phases.setdefault(at, min(since, self._period_ns - 1))
        half = 0 if self._free else self._period_ns // 2
        self._pass_to((since - phase + half) // self._period_ns)

    def _begin(self, now_ns: int) -> None:
        self._origin_ns = now_ns
        self._slot = 0
        for motor in self.motors:
            motor.free = True


def _planned_faults(motor: Body, quirks: Quirks) -> list[Planned]:
    """Return the faults planned for a motor, each with its time [s]."""

    def fall_silent(now_ns: int) -> None:
        motor.power_on()
        motor.present = False

    def restart(now_ns: int) -> None:
        motor.power_on()

    def fail(now_ns: int) -> None:
        motor.fail(quirks.error)

    def derate(now_ns: int) -> None:
        motor.derated = quirks.derated_to

    return [
        (quirks.derates_at_s, derate),
        (quirks.silent_at_s, fall_silent),
        (quirks.restarts_at_s, restart),
        (quirks.error_at_s, fail),
    ]
