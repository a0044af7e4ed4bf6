"""The physics a simulated axis can have, each the state around a pure model.

All offer `step`, `stored` and `forces`; works and losses are running totals [J].
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from tautwave.models.foam import FoamParams, foam_forces, foam_stored
from tautwave.models.integrators.schemes import integrate_step
from tautwave.models.part_contact import PartContact, part_forces, part_step, part_stored
from tautwave.models.plant import plant_forces, plant_step, plant_stored
from tautwave.models.plant_params import PlantParams, plant_cache
from tautwave.models.servo import ServoParams, servo_forces, servo_step, servo_stored

CACHES = 64
"""Laws of a motor whose coefficients are kept."""


class MotorLaw(NamedTuple):
    """What a motor does by itself between two commands, beside the effort; SI of its axis.

    A spring of `stiffness` to the position `anchor`, and a damper of `damping`.
    """

    stiffness: float
    anchor: float
    damping: float


NO_LAW = MotorLaw(0.0, 0.0, 0.0)


class Physics(Protocol):
    """What a simulated axis needs of its physics."""

    x: float
    v: float
    hand_work: float
    motor_work: float
    grip_loss: float
    viscous_loss: float
    coulomb_loss: float
    environment_loss: float

    def obey(self, law: MotorLaw) -> None:
        """Have the motor do this by itself from now on."""
        ...

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` [s] under a constant command and a hand reference of constant rate."""
        ...

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and environment energy [J]."""
        ...

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment on the device [N m or N]."""
        ...


class PlantPhysics:
    """An impedance device on piecewise-linear surroundings, exact between located events.

    So are spring and damper of its motor: they are linear, and join those that are there.
    """

    def __init__(self, params: PlantParams, period: float, x: float) -> None:
        self._bare = self._params = params
        self._period = period
        self._cache = plant_cache(params, period)
        self._caches = {(0.0, 0.0): self._cache}
        self._law = NO_LAW
        self._mode = 0
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def obey(self, law: MotorLaw) -> None:
        """Have the motor's spring and damper act from now on."""
        if law == self._law:
            return
        self._law = law
        self._params = bare = self._bare
        if any(law):
            stiffness = bare.spring_stiffness + law.stiffness
            held = bare.spring_stiffness * bare.spring_position + law.stiffness * law.anchor
            self._params = bare._replace(
                viscous=bare.viscous + law.damping,
                spring_stiffness=stiffness,
                spring_position=held / stiffness if stiffness > 0.0 else bare.spring_position,
            )
        key = law.stiffness, law.damping
        if key not in self._caches:
            if len(self._caches) > CACHES:
                self._caches = {(0.0, 0.0): self._caches[0.0, 0.0]}
            self._caches[key] = plant_cache(self._params, self._period)
        self._cache = self._caches[key]

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held effort and the motor's law."""
        before = self.x
        self.x, self.v, self._mode, work, grip, viscous, coulomb, environment = plant_step(
            self._params, self._cache, before, self.v, self._mode, command, reference, rate, h
        )
        self.motor_work += command * (self.x - before)
        if self._law is not NO_LAW:
            stiffness, anchor, damping = self._law
            if damping > 0.0:
                share = damping / self._params.viscous * viscous
                viscous -= share
                self.motor_work -= share
            # The spring's effort is linear in the position: its mean is that half-way.
            self.motor_work += stiffness * (anchor - 0.5 * (before + self.x)) * (self.x - before)
        self.hand_work += work
        self.grip_loss += grip
        self.viscous_loss += viscous
        self.coulomb_loss += coulomb
        self.environment_loss += environment

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and environment energy."""
        return plant_stored(self._bare, self.x, self.v, reference)

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment."""
        return plant_forces(self._bare, self.x, self.v, reference, rate)


class ContactPhysics:
    """An impedance device at a foam, by the integrator its parameters name, or at a part."""

    def __init__(self, params: PlantParams, contact: FoamParams | PartContact, x: float) -> None:
        self._bare = self._params = params
        self._law = NO_LAW
        self._contact: Any = contact
        self._functions: tuple[Callable[..., Any], ...] = (part_step, part_stored, part_forces)
        if isinstance(contact, FoamParams):
            self._functions = (integrate_step, foam_stored, foam_forces)
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def obey(self, law: MotorLaw) -> None:
        """Have the motor's damper act from now on; its spring is held over a step."""
        self._law = law
        self._params = self._bare._replace(viscous=self._bare.viscous + law.damping)

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held effort and the motor's law."""
        before = self.x
        if self._law is not NO_LAW:
            command += self._law.stiffness * (self._law.anchor - before)
        self.x, self.v, work, grip, viscous, coulomb, environment = self._functions[0](
            self._params, self._contact, before, self.v, command, reference, rate, h
        )
        self.motor_work += command * (self.x - before)
        if self._law.damping > 0.0:
            share = self._law.damping / self._params.viscous * viscous
            viscous -= share
            self.motor_work -= share
        self.hand_work += work
        self.grip_loss += grip
        self.viscous_loss += viscous
        self.coulomb_loss += coulomb
        self.environment_loss += environment

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and contact energy."""
        energies: tuple[float, float, float] = self._functions[1](
            self._bare, self._contact, self.x, self.v, reference
        )
        return energies

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and contact."""
        efforts: tuple[float, float] = self._functions[2](
            self._bare, self._contact, self.x, self.v, reference, rate
        )
        return efforts


class ServoPhysics:
    """An admittance device: its velocity follows the command with a first-order lag.

    Its drive has a law already, and no other.
    """

    def obey(self, law: MotorLaw) -> None:
        """Take none."""

    def __init__(self, params: ServoParams, x: float) -> None:
        self._params = params
        self._command = 0.0
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held velocity command."""
        self._command = command
        self.x, self.v, work, grip, environment, outside = servo_step(
            self._params, self.x, self.v, command, reference, rate, h
        )
        self.motor_work -= outside
        self.hand_work += work
        self.grip_loss += grip
        self.environment_loss += environment

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic (of the hand's mass), grip and environment energy."""
        return servo_stored(self._params, self.x, self.v, reference)

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment."""
        return servo_forces(self._params, self.x, self.v, self._command, reference, rate)


class ImposedPhysics:
    """An axis that is forced along a recorded motion: what its motor gives, that force takes."""

    def __init__(self, x: float) -> None:
        self._command = 0.0
        self._law = NO_LAW
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def obey(self, law: MotorLaw) -> None:
        """Have the motor's law act from now on, held over a step as it is at its beginning."""
        self._law = law

    def _with_law(self, command: float, speed: float) -> float:
        """Return the motor's effort, its law included, at a velocity [rad/s or m/s]."""
        if self._law is NO_LAW:
            return command
        stiffness, anchor, damping = self._law
        return command + stiffness * (anchor - self.x) - damping * speed

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` with the reference."""
        before = self.x
        self._command = command = self._with_law(command, rate)
        self.x = reference + rate * h
        self.v = rate
        self.motor_work += command * (self.x - before)
        self.hand_work -= command * (self.x - before)

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return no energy: what the recorded device stored is not known."""
        return 0.0, 0.0, 0.0

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return what holds the motor's effort, beyond what moved the recorded device."""
        return -self._command, 0.0


class OutsidePhysics(ImposedPhysics):
    """An axis that a program moves: `place` says where it is when the slot has passed."""

    def __init__(self, x: float) -> None:
        super().__init__(x)
        self._next = (x, 0.0)

    def place(self, x: float, v: float) -> None:
        """Say where the axis is at the next slot; before the first, where it begins."""
        self._next = (x, v)

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Be there; a part of a slot is passed with the whole of it."""
        del reference, rate, h
        x, v = self._next
        self._command = command = self._with_law(command, v)
        self.motor_work += command * (x - self.x)
        self.hand_work -= command * (x - self.x)
        self.x, self.v = x, v


class PhysicsAround:
    """A device beside whose motor an effort acts; its books, less what that did."""

    def __init__(self, bare: Physics) -> None:
        self._bare = bare
        self._work = 0.0
        self._show(0.0)

    def obey(self, law: MotorLaw) -> None:
        """Have the device's motor act by itself."""
        self._bare.obey(law)

    def _show(self, lost: float) -> None:
        bare = self._bare
        self.x = bare.x
        self.v = bare.v
        self.hand_work = bare.hand_work
        self.motor_work = bare.motor_work - self._work
        self.grip_loss = bare.grip_loss
        self.viscous_loss = bare.viscous_loss
        self.coulomb_loss = bare.coulomb_loss
        self.environment_loss = bare.environment_loss - lost


class PushedPhysics(PhysicsAround):
    """A device on which an effort acts that does not depend on it; `push` is that of this slot."""

    def __init__(self, bare: Physics, *, servo: bool) -> None:
        super().__init__(bare)
        self._servo = servo
        self.push = 0.0

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h`; a drive that takes velocities feels the effort and gives no way."""
        before = self.x
        total = command if self._servo else command + self.push
        self._bare.step(total, reference, rate, h)
        self._work += self.push * (self._bare.x - before)
        self._show(self._work)

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and environment energy."""
        return self._bare.stored(reference)

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment, with what pushes."""
        hand, environment = self._bare.forces(reference, rate)
        return hand, environment + self.push
