"""Simulated MIT motors on one CAN bus: its wire, its motors, and the slots that they move on.

A slot begins with the first command of a cycle: all axes move to it, are measured there, and what
each motor is told in that cycle acts from it on. The commands of a cycle follow one another on the
wire; each motor's place in it is learnt in the first. The slots begin with the first command after
all motors are enabled; until then the axes are held. Where no command comes, the axes move on half
a period late, so that a watchdog that trips is felt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from tautwave.contracts import BusSpec
from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.mit.motor import ON, Motor
from tautwave_sim.mit.options import Quirks, SimulatedMitOptions
from tautwave_sim.wire.can import CanTiming
from tautwave_sim.wire.can_faults import CanFaultPlan
from tautwave_sim.wire.can_world import CanWorld


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
        seed = truths[0].seed[:1] if truths else ()
        plan = CanFaultPlan(options.simulator.faults, seed)
        timing = CanTiming(options.bitrate, options.data_bitrate)
        super().__init__(timing, plan, bus.period_ns, now_ns)
        self._free = options.simulator.free
        self._slot = 0
        self.motors: list[Motor] = []
        self.axes: list[SimulatedAxis] = []
        self._phases: dict[int, int] = {}
        self._due: list[tuple[int, int, Callable[[], None]]] = []
        known = {motor.id: motor for motor in options.motors}
        for spec, truth in zip(bus.axes, truths, strict=True):
            if spec.device_id not in known:
                raise ConfigError(
                    f"bus {bus.name}: {spec.name} has id {spec.device_id}, which options.motors "
                    "does not list; add it there"
                )
            at = len(self.motors)
            port = self.medium.port(partial(self._hear, at))
            quirks = options.simulator.motors.get(spec.device_id, Quirks())
            motor = Motor(known[spec.device_id], quirks, spec.name, truth, timing.fd, port.send)
            self.motors.append(motor)
            self.axes.append(motor.axis)
            motor.free = motor.axis.in_hand
            self._due += [
                (round(at_s * 1e9), at, action)
                for at_s, action in _planned_faults(motor, quirks)
                if at_s is not None
            ]
        self._due.sort(key=lambda due: due[:2])

    # -- events ---------------------------------------------------------------------------

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself."""
        times = [self.medium.next_event_ns(), self._tick_ns()]
        times += [motor.next_event_ns() for motor in self.motors]
        if self._due and self._origin_ns is not None:
            times.append(self._origin_ns + self._due[0][0])
        return min((time for time in times if time is not None), default=None)

    def _tick_ns(self) -> int | None:
        """Return when the next slot begins if no command does it."""
        if self._origin_ns is None:
            return None
        late = 0 if self._free else self._period_ns // 2
        return self._origin_ns + (self._slot + 1) * self._period_ns + late

    def advance(self, to_ns: int) -> None:
        """Let everything happen that happens up to `to_ns`, in its order."""
        while True:
            at_ns = self.next_event_ns()
            if at_ns is None or at_ns > to_ns:
                break
            self._step(at_ns)
        self.medium.advance(to_ns)

    def _step(self, at_ns: int) -> None:
        due = self.medium.next_event_ns()
        if due is not None and due <= at_ns:
            self.medium.step(due)
            return
        self.medium.now_ns = max(self.medium.now_ns, at_ns)
        while self._due and self._origin_ns is not None:
            if self._origin_ns + self._due[0][0] > at_ns:
                break
            _, _, action = self._due.pop(0)
            action()
        tick_ns = self._tick_ns()
        if tick_ns is not None and tick_ns <= at_ns:
            self._pass_to(self._slot + 1)
        for motor in self.motors:
            motor.run(at_ns)

    # -- slots ----------------------------------------------------------------------------

    def _pass_to(self, slot: int) -> None:
        while self._slot < slot:
            self._slot += 1
            for motor in self.motors:
                motor.pass_slot()

    def _hear(self, at: int, now_ns: int, can_id: int, data: bytes) -> None:
        motor = self.motors[at]
        if not motor.hears(can_id):
            return
        special = data[:7] == bytes((0xFF,) * 7)
        if can_id == motor.keys.id and not special:
            self._slot_of(at, now_ns)
        motor.receive(now_ns, can_id, data)
        if self._free and self._origin_ns is None and motor.state == ON:
            self._begin(now_ns)

    def _slot_of(self, at: int, now_ns: int) -> None:
        """Bring all axes to the slot of a command."""
        if self._origin_ns is None:
            if not all(motor.state == ON for motor in self.motors):
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


def _planned_faults(motor: Motor, quirks: Quirks) -> list[tuple[float | None, Callable[[], None]]]:
    """Return what befalls a motor, and when [s]."""

    def fall_silent() -> None:
        motor.power_on()
        motor.present = False

    return [
        (quirks.silent_at_s, fall_silent),
        (quirks.restarts_at_s, motor.power_on),
        (quirks.error_at_s, lambda: motor.fail(quirks.error)),
    ]
