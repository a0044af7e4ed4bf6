"""One simulated axis: physics, encoder, motor and their faults. Every simulator is built on it.

It moves on the slots of the loop's grid, like a drive that latches position and command on a
hardware SYNC: host lateness below half a period moves neither. A command acts `command_delay`
periods after the slot it was written in; until then, and while nothing is written, the last one
acts on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from tautwave.contracts import Row
from tautwave.models.encoder import quantise
from tautwave.models.sensors.effort import SensorParams, follow_effort, sensor_reading
from tautwave.streams import MISSING, NOISE, SENSOR, normal_stream, uniform_stream
from tautwave.truth import ArmModel, AxisModel, PositionLoop, truth_columns
from tautwave.types import JointState
from tautwave_sim.loaded import ArmPhysics, JointPhysics, LoadedPhysics
from tautwave_sim.physics import (
    NO_LAW,
    ContactPhysics,
    ImposedPhysics,
    MotorLaw,
    OutsidePhysics,
    Physics,
    PlantPhysics,
    PushedPhysics,
    ServoPhysics,
)

LOOP_SHARE = 0.05
"""Step of a simulated position loop, as a share of its fastest time constant."""


def make_physics(truth: AxisModel) -> Physics:
    """Return the physics that the truth asks for, at rest at its start position."""
    if truth.imposed:
        return ImposedPhysics(truth.start_position)
    if len(truth.push):
        bare = make_physics(truth._replace(push=()))
        return PushedPhysics(bare, servo=truth.servo is not None)
    if truth.arm is not None:
        return JointPhysics(truth.plant, truth.start_position)
    if truth.load is not None:
        return LoadedPhysics(make_physics(truth._replace(load=None)), truth.load)
    if truth.servo is not None:
        return ServoPhysics(truth.servo, truth.start_position)
    if truth.part is not None:
        return ContactPhysics(truth.plant, truth.part, truth.start_position)
    if truth.foam is not None:
        return ContactPhysics(truth.plant, truth.foam, truth.start_position)
    return PlantPhysics(truth.plant, truth.period, truth.start_position)


def join_arms(axes: Sequence[SimulatedAxis], truths: Sequence[AxisModel]) -> list[ArmPhysics]:
    """Return the arms whose joints are among some axes of a bus, which are joined by this."""
    joints: dict[ArmModel, list[JointPhysics]] = {}
    for axis, truth in zip(axes, truths, strict=True):
        if truth.arm is not None and isinstance(axis.physics, JointPhysics):
            joints.setdefault(truth.arm, []).append(axis.physics)
    arms = []
    for model, own in joints.items():
        arm = ArmPhysics(model, own)
        for joint in own:
            joint.arm = arm
        arms.append(arm)
    return arms


def _loop_steps(loop: PositionLoop, truth: AxisModel) -> int:
    """Return how often a period a drive's position loop has to be at work to be as meant."""
    mass = truth.plant.mass
    fastest = max(loop.damping / mass, math.sqrt(loop.stiffness / mass))
    return min(64, max(1, math.ceil(truth.period * fastest / LOOP_SHARE)))


class EffortSensor:
    """A sensor between a device and what is outside it, moved by each slot."""

    def __init__(self, params: SensorParams, period: float, seed: tuple[int, ...]) -> None:
        self._params = params
        self._period = period
        self._noise = normal_stream(seed, ())
        self._pipe = deque([0.0] * params.delay)
        self._state = 0.0
        self._shown = 0.0
        self._speed = 0.0

    def begin(self, physics: Physics, reference: float, rate: float) -> None:
        """Show what acts on a device at rest."""
        hand, environment = physics.forces(reference, rate)
        self._state = self._shown = hand + environment
        self._pipe = deque([self._state] * self._params.delay)

    def follow(self, physics: Physics, reference: float, rate: float) -> None:
        """Follow the effort after a slot; a mass beyond the sensor takes its share."""
        p = self._params
        hand, environment = physics.forces(reference, rate)
        outside = hand + environment - p.mass * (physics.v - self._speed) / self._period
        self._speed = physics.v
        self._state = self._shown = follow_effort(p, self._state, outside)
        if self._pipe:
            self._pipe.append(self._state)
            self._shown = self._pipe.popleft()

    def read(self) -> float:
        """Return what it shows at this slot [N m or N]."""
        noise = next(self._noise) if self._params.noise > 0.0 else 0.0
        return sensor_reading(self._params, self._shown, noise)


class SimulatedAxis:
    """The truth of one axis, and what its drive reports of it.

    Parameters
    ----------
    name : str
        `master.wrist` or `slave.wrist`.
    truth : AxisModel
        Physics, motor, encoder and faults.
    loop : PositionLoop, optional
        With it, commands are positions; a simulated drive with registers has its own.
    """

    def __init__(self, name: str, truth: AxisModel, loop: PositionLoop | None = None) -> None:
        self.name = name
        self.period = truth.period
        self._servo = truth.servo is not None
        self._command_quantum = truth.velocity_quantum if self._servo else truth.effort_quantum
        self._effort_quantum = truth.effort_quantum
        self._effort_limit = truth.effort_limit
        self._encoder_quantum = truth.encoder_quantum
        self._position_noise = truth.position_noise
        self._missing_probability = truth.missing_probability
        self.physics = make_physics(truth)
        whole = math.floor(truth.command_delay + 1e-9)
        share = truth.command_delay - whole
        self._late = share if share > 1e-9 else 0.0
        self._pipe = deque([0.0] * whole)
        self._acting = 0.0
        self._command = 0.0
        self._law = self._acting_law = NO_LAW
        self._laws = deque([NO_LAW] * whole)
        self._obeys = False
        self._loop = loop
        self._step = self.physics.step
        self._loop_steps = 1
        if self._loop is not None:
            self._command = self._acting = truth.start_position
            self._pipe.extend([truth.start_position] * whole)
            for _ in range(whole):
                self._pipe.popleft()
            self._loop_steps = _loop_steps(self._loop, truth)
            self._step = self._move_to
        self._grasp = truth.grasp
        self.in_hand = truth.grasp is not None
        self.lead = truth.lead
        self._reference = truth.reference
        self._last = len(truth.reference) - 1
        self._push = truth.push
        self._pushed = self.physics if isinstance(self.physics, PushedPhysics) else None
        self._slot = 0
        self._noise = normal_stream((*truth.seed, NOISE), truth.colour)
        self._missing = uniform_stream((*truth.seed, MISSING))
        self._hand = self._hand_at(0)
        self._push_at(0)
        self.sensor = None
        if truth.sensor is not None:
            self.sensor = EffortSensor(truth.sensor, truth.period, (*truth.seed, SENSOR))
            self.sensor.begin(self.physics, *self._hand)
        self.columns = truth_columns(name, hand=self._last >= 0)

    def command(self, value: float, law: MotorLaw = NO_LAW) -> None:
        """Take an effort (impedance) or a velocity (admittance) for the slots to come.

        With a position loop of its own it takes a position; NaN: it stays where it is to go. What
        an impedance axis' motor does by itself comes with the effort, and acts beside it.
        """
        self._law = law
        self._obeys = self._obeys or law is not NO_LAW
        if self._loop is not None:
            if not math.isnan(value):
                self._command = value
            return
        if self._command_quantum > 0.0:
            value = quantise(value, self._command_quantum)
        if not self._servo:
            limit = self._effort_limit
            value = limit if value > limit else -limit if value < -limit else value
        self._command = value

    def hand(self) -> tuple[float, float]:
        """Return the hand's reference [rad or m] at this slot and its rate until the next."""
        return self._hand

    def give_over(self) -> OutsidePhysics | None:
        """Let a program move the axis from now on, by what is returned; None: an arm moves it."""
        if isinstance(self.physics, JointPhysics):
            return None
        self.physics = outside = OutsidePhysics(self.physics.x)
        self._step = outside.step
        return outside

    def acting(self) -> float:
        """Return the mean of what acts until the next slot: effort, or an admittance's velocity."""
        command = self._pipe[0] if self._pipe else self._command
        return self._late * self._acting + (1.0 - self._late) * command

    def _hand_at(self, slot: int) -> tuple[float, float]:
        if self.lead is not None:
            return self.lead.aim(self.physics.x)
        if slot < self._last:
            here = self._reference[slot]
            return here, (self._reference[slot + 1] - here) / self.period
        if self._last >= 0:
            return self._reference[self._last], 0.0
        return 0.0, 0.0

    def _push_at(self, slot: int) -> None:
        if self._pushed is not None:
            self._pushed.push = self._push[min(slot, len(self._push) - 1)]

    def push(self, effort: float) -> None:
        """Put an effort [N m or N] on an axis that something pushes, until the next slot."""
        if self._pushed is not None:
            self._pushed.push = effort

    def pass_slot(self) -> None:
        """Move by one slot of the loop's grid."""
        reference, rate = self._hand
        command = self._command
        if self._pipe:
            self._pipe.append(command)
            command = self._pipe.popleft()
        law = self._law_now() if self._obeys else NO_LAW
        if self._grasp is not None:
            command += self._grasp(self.physics.x, self.physics.v, self.period)
        if self._late > 0.0:
            late = self._late * self.period
            if self._obeys:
                self.physics.obey(self._acting_law)
            self._step(self._acting, reference, rate, late)
            if self._obeys:
                self.physics.obey(law)
                self._acting_law = law
            self._step(command, reference + rate * late, rate, self.period - late)
            self._acting = command
        else:
            if self._obeys:
                self.physics.obey(law)
            self._step(command, reference, rate, self.period)
        self._arrive()

    def _law_now(self) -> MotorLaw:
        """Return the law that comes to act in this slot, as late as the effort beside it."""
        if not self._laws:
            return self._law
        self._laws.append(self._law)
        return self._laws.popleft()

    def _move_to(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under the drive's own position loop."""
        assert self._loop is not None
        stiffness, damping = self._loop
        physics, limit, share = self.physics, self._effort_limit, h / self._loop_steps
        for step in range(self._loop_steps):
            effort = stiffness * (command - physics.x) - damping * physics.v
            effort = limit if effort > limit else -limit if effort < -limit else effort
            physics.step(effort, reference + rate * share * step, rate, share)

    def _arrive(self) -> None:
        """Come to the next slot: what hand, environment and sensor are there."""
        self._slot += 1
        self._hand = self._hand_at(self._slot)
        self._push_at(self._slot)
        if self.sensor is not None:
            self.sensor.follow(self.physics, *self._hand)

    def measure(self) -> JointState:
        """Return what the drive reports at this slot."""
        position = self.physics.x
        if self._position_noise > 0.0:
            position += self._position_noise * next(self._noise)
        if self._encoder_quantum > 0.0:
            position = quantise(position, self._encoder_quantum)
        valid = True
        if self._missing_probability > 0.0 and self._slot > 0:
            valid = next(self._missing) >= self._missing_probability
        effort = math.nan
        if self._servo:
            reference, rate = self._hand
            one, other = self.physics.forces(reference, rate)
            effort = one + other
            if self._effort_quantum > 0.0:
                effort = quantise(effort, self._effort_quantum)
        elif self.sensor is not None:
            effort = self.sensor.read()
        return JointState(position, math.nan, effort, valid, 0)

    def fill(self, row: Row, at: int) -> None:
        """Write the truth at this slot into `row` from index `at` on."""
        physics = self.physics
        reference, rate = self._hand
        hand, environment = physics.forces(reference, rate)
        row[at] = physics.x
        row[at + 1] = physics.v
        at += 2
        if self._last >= 0:
            row[at] = reference
            row[at + 1] = hand
            at += 2
        row[at] = environment
        row[at + 1] = physics.hand_work
        row[at + 2] = physics.motor_work
        row[at + 3], row[at + 4], row[at + 5] = physics.stored(reference)
        row[at + 6] = physics.grip_loss
        row[at + 7] = physics.viscous_loss
        row[at + 8] = physics.coulomb_loss
        row[at + 9] = physics.environment_loss
