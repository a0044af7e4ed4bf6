"""The four physics a simulated axis can have, each the state around a pure model.

All offer `step`, `stored` and `forces`; works and losses are running totals [J].
"""

from __future__ import annotations

from typing import Protocol

from tautwave.models.foam import FoamParams, foam_forces, foam_stored
from tautwave.models.integrators.schemes import integrate_step
from tautwave.models.part_contact import PartContact, part_forces, part_step, part_stored
from tautwave.models.plant import plant_forces, plant_step, plant_stored
from tautwave.models.plant_params import PlantParams, plant_cache
from tautwave.models.servo import ServoParams, servo_forces, servo_step, servo_stored


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
    """An impedance device on piecewise-linear surroundings, exact between located events."""

    def __init__(self, params: PlantParams, period: float, x: float) -> None:
        self._params = params
        self._cache = plant_cache(params, period)
        self._mode = 0
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held effort."""
        before = self.x
        self.x, self.v, self._mode, work, grip, viscous, coulomb, environment = plant_step(
            self._params, self._cache, before, self.v, self._mode, command, reference, rate, h
        )
        self.motor_work += command * (self.x - before)
        self.hand_work += work
        self.grip_loss += grip
        self.viscous_loss += viscous
        self.coulomb_loss += coulomb
        self.environment_loss += environment

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and environment energy."""
        return plant_stored(self._params, self.x, self.v, reference)

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment."""
        return plant_forces(self._params, self.x, self.v, reference, rate)


class FoamPhysics:
    """An impedance device at a contact, by the integrator its parameters name."""

    def __init__(self, params: PlantParams, foam: FoamParams, x: float) -> None:
        self._params = params
        self._foam = foam
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held effort."""
        before = self.x
        self.x, self.v, work, grip, viscous, coulomb, environment = integrate_step(
            self._params, self._foam, before, self.v, command, reference, rate, h
        )
        self.motor_work += command * (self.x - before)
        self.hand_work += work
        self.grip_loss += grip
        self.viscous_loss += viscous
        self.coulomb_loss += coulomb
        self.environment_loss += environment

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and contact energy."""
        return foam_stored(self._params, self._foam, self.x, self.v, reference)

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and contact."""
        return foam_forces(self._params, self._foam, self.x, self.v, reference, rate)


class PartPhysics:
    """An impedance device at an environment that is a part."""

    def __init__(self, params: PlantParams, part: PartContact, x: float) -> None:
        self._params = params
        self._part = part
        self.x = x
        self.v = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held effort."""
        before = self.x
        self.x, self.v, work, grip, viscous, coulomb, environment = part_step(
            self._params, self._part, before, self.v, command, reference, rate, h
        )
        self.motor_work += command * (self.x - before)
        self.hand_work += work
        self.grip_loss += grip
        self.viscous_loss += viscous
        self.coulomb_loss += coulomb
        self.environment_loss += environment

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and environment energy."""
        return part_stored(self._params, self._part, self.x, self.v, reference)

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment."""
        return part_forces(self._params, self._part, self.x, self.v, reference, rate)


class ServoPhysics:
    """An admittance device: its velocity follows the command with a first-order lag."""

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
