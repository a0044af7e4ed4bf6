"""How a drive moves its motor: set-point generators and the loops under them, slot by slot.

In the torque modes the set-point acts as it is. In all others a speed loop, and around it a
position loop, command the torque of an impedance axis or the velocity of a servo; their gains are
shares of what one slot allows, so that they are stable at any period, with a period of delay too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave_sim.canopen.dictionary import ObjectDictionary
from tautwave_sim.canopen.motor import Motor

PP, PV, PT, HM, CSP, CSV, CST = 1, 3, 4, 6, 8, 9, 10

SPEED_SHARE = 0.2
"""Share of a speed error that is corrected in one slot."""
INTEGRAL_SHARE = 0.01
POSITION_SHARE = 0.04
LAG_SHARE = 0.2


class Setpoint(NamedTuple):
    """Where the generators are [SI], the integral of the speed loop, and the torque [counts]."""

    position: float
    velocity: float
    integral: float
    torque: float


class Control:
    """Set-points and loops of one motor.

    Parameters
    ----------
    objects : ObjectDictionary
        Targets and limits.
    motor : Motor
        What is moved.
    torque_step : int
        Per mille that the drive's current loop resolves.
    """

    def __init__(self, objects: ObjectDictionary, motor: Motor, torque_step: int = 1) -> None:
        self._objects = objects
        self._torque_step = torque_step
        self._motor = motor
        self._now = Setpoint(motor.position(), 0.0, 0.0, 0.0)
        self._before = self._now
        self._slot = -1
        self.target_position = 0
        """Of PP [counts], as its set-point was accepted."""
        self.limited = False

    @property
    def demand(self) -> Setpoint:
        """Set-point of this slot."""
        return self._now

    def take_over(self) -> None:
        """Begin at what the motor does."""
        motor = self._motor
        position = motor.position()
        self._now = self._before = Setpoint(position, motor.velocity(), 0.0, 0.0)
        self.target_position = motor.position_counts
        self.limited = False

    def _begin(self, slot: int) -> Setpoint:
        """Return the state at the beginning of this slot, the same on every call."""
        if slot == self._slot:
            return self._before
        self._slot = slot
        self._before = self._now
        return self._before

    def rest(self) -> None:
        """No torque, or no speed of a servo."""
        if self._motor.servo:
            self._motor.drive_velocity(0.0)
        else:
            self._motor.drive_torque(0)

    def brake(self, slot: int, deceleration: int) -> bool:
        """Slow down; return True once the ramp is at its end, with the motor held there."""
        before = self._begin(slot)
        step = self._step(deceleration)
        velocity = _towards(before.velocity, 0.0, step)
        self._follow_speed(before, velocity)
        return velocity == 0.0

    def run(self, slot: int, mode: int, *, halt: bool) -> None:
        """Act according to the mode."""
        before = self._begin(slot)
        if mode in (CST, PT):
            self._torque(before, mode, halt)
        elif mode in (PV, CSV):
            self._speed(before, mode, halt)
        elif mode in (PP, CSP):
            self._position(before, mode, halt)
        elif mode == HM:
            self._follow_position(before, before.position, 0.0)
        else:
            self.rest()

    def _step(self, acceleration: int) -> float:
        """Return the change of speed in one slot; an acceleration of 0 is none that limits."""
        if acceleration == 0:
            return math.inf
        return abs(self._motor.velocity_of(acceleration)) * self._motor.period

    def _halt_step(self) -> float:
        """Return the change of speed in one slot of a halt (605Dh)."""
        quick = self._objects.number(0x605D) == 2
        return self._step(self._objects.number(0x6085 if quick else 0x6084))

    def _torque(self, before: Setpoint, mode: int, halt: bool) -> None:
        number = self._objects.number
        wanted = float(number(0x6071))
        if mode == CST:
            wanted += number(0x60B2)
        if halt:
            wanted = 0.0
        if mode == PT:
            step = number(0x6087) * self._motor.period
            wanted = _towards(before.torque, wanted, step if step > 0.0 else math.inf)
        self._now = Setpoint(self._motor.position(), self._motor.velocity(), 0.0, wanted)
        self._act(wanted)

    def _speed(self, before: Setpoint, mode: int, halt: bool) -> None:
        number, motor = self._objects.number, self._motor
        if mode == CSV and not halt:
            velocity = motor.velocity_of(number(0x60FF) + number(0x60B1))
        else:
            target = 0.0 if halt else motor.velocity_of(number(0x60FF))
            faster = abs(target) > abs(before.velocity) and target * before.velocity >= 0.0
            step = self._halt_step() if halt else self._step(number(0x6083 if faster else 0x6084))
            velocity = _towards(before.velocity, target, step)
        self._follow_speed(before, velocity)

    def _position(self, before: Setpoint, mode: int, halt: bool) -> None:
        number, motor = self._objects.number, self._motor
        if halt:
            velocity = _towards(before.velocity, 0.0, self._halt_step())
            position = before.position + velocity * motor.period
        elif mode == CSP:
            position = motor.position_of(number(0x607A) + number(0x60B0))
            velocity = (position - before.position) / motor.period
            greatest = abs(motor.velocity_of(number(0x6080)))
            if abs(velocity) > greatest > 0.0:
                velocity = math.copysign(greatest, velocity)
                position = before.position + velocity * motor.period
        else:
            position, velocity = self._profile(before)
        self._follow_position(before, position, velocity)

    def _profile(self, before: Setpoint) -> tuple[float, float]:
        """Return position and speed at the end of the slot on the way to PP's target."""
        number, motor = self._objects.number, self._motor
        period = motor.period
        way = motor.position_of(self.target_position) - before.position
        slower = self._step(number(0x6084))
        limit = abs(motor.velocity_of(number(0x6081)))
        if math.isfinite(slower):
            limit = min(limit, math.sqrt(2.0 * slower / period * abs(way)))
        wanted = math.copysign(limit, way)
        faster = abs(wanted) > abs(before.velocity) and wanted * before.velocity >= 0.0
        step = self._step(number(0x6083)) if faster else slower
        velocity = _towards(before.velocity, wanted, step)
        if abs(way) <= abs(velocity) * period or abs(way) <= 0.5 * motor.scale.position:
            return motor.position_of(self.target_position), 0.0
        return before.position + velocity * period, velocity

    def _follow_position(self, before: Setpoint, position: float, velocity: float) -> None:
        motor = self._motor
        gain = POSITION_SHARE / motor.period
        if motor.servo and motor.lag > 0.0:
            gain = min(gain, LAG_SHARE / motor.lag)
        asked = velocity + gain * (before.position - motor.position())
        self._follow_speed(before, asked, change=velocity - before.velocity)
        self._now = self._now._replace(position=position, velocity=velocity)

    def _follow_speed(self, before: Setpoint, velocity: float, change: float | None = None) -> None:
        motor = self._motor
        if motor.servo:
            self._now = Setpoint(motor.position(), velocity, 0.0, 0.0)
            motor.drive_velocity(velocity)
            return
        if change is None:
            change = velocity - before.velocity
        stiff = motor.mass / motor.period
        error = velocity - motor.velocity()
        integral = before.integral + INTEGRAL_SHARE * stiff * error
        effort = stiff * (SPEED_SHARE * error + change) + motor.viscous * velocity
        offset = self._objects.number(0x60B2)
        wanted = motor.scale.direction * (effort + integral) / motor.scale.effort + offset
        self._act(wanted)
        if self.limited:
            integral = before.integral  # what cannot act is not summed up
        self._now = Setpoint(motor.position(), velocity, integral, wanted)

    def _act(self, wanted: float) -> None:
        greatest = self._objects.number(0x6072)
        self.limited = abs(wanted) > greatest
        held = min(max(wanted, -greatest), greatest)
        step = self._torque_step
        self._motor.drive_torque(math.floor(held / step + 0.5) * step)


def _towards(value: float, target: float, step: float) -> float:
    if abs(target - value) <= step:
        return target
    return value + math.copysign(step, target - value)
