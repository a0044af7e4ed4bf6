"""Simulated axes that weigh: a load on one, or several that are the joints of one arm.

Works and losses are running totals [J]; SI.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from tautwave.columns import names, under
from tautwave.contracts import Row
from tautwave.models.chain.motion import Acting, Flows, chain_step, kinetic_energy, place_chain
from tautwave.models.load import LoadParams, load_effort, load_energy
from tautwave.models.plant import plant_forces, plant_stored
from tautwave.models.plant_params import PlantParams
from tautwave.truth import ARM, ArmModel
from tautwave_sim.physics import NO_LAW, MotorLaw, Physics, PhysicsAround


class LoadedPhysics(PhysicsAround):
    """A device with a load beside its motor, held over a step as it is half-way.

    What that is wrong by is booked: as a loss of the environment, of either sign.
    """

    def __init__(self, bare: Physics, load: LoadParams) -> None:
        super().__init__(bare)
        self._load = load
        self._defect = 0.0
        self._height = load_energy(load, bare.x)

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Move by `h` under a held effort and the load."""
        before = self.x
        effort = load_effort(self._load, before + 0.5 * h * self.v)
        self._bare.step(command + effort, reference, rate, h)
        work = effort * (self._bare.x - before)
        height = load_energy(self._load, self._bare.x)
        self._work += work
        self._defect += work + height - self._height
        self._height = height
        self._show(self._defect)

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return kinetic, grip and environment energy, with the load's potential."""
        kinetic, grip, environment = self._bare.stored(reference)
        return kinetic, grip, environment + self._height

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment, without the load."""
        return self._bare.forces(reference, rate)


class JointPhysics:
    """One joint of an arm, as a simulated axis sees it; `kinetic` is what it gave to the arm."""

    def __init__(self, plant: PlantParams, x: float) -> None:
        self.plant = self.acting = plant
        self._law = NO_LAW
        self.asked: list[tuple[float, float, float, float]] = []
        self.arm: ArmPhysics | None = None
        self.x = x
        self.v = 0.0
        self.given = 0.0
        self.hand_work = self.motor_work = 0.0
        self.grip_loss = self.viscous_loss = self.coulomb_loss = self.environment_loss = 0.0

    def obey(self, law: MotorLaw) -> None:
        """Have the motor's damper act from now on; its spring is held over a step."""
        self._law = law
        self.acting = self.plant._replace(viscous=self.plant.viscous + law.damping)

    def step(self, command: float, reference: float, rate: float, h: float) -> None:
        """Ask for a step of `h`; the arm makes it once all of its joints have asked."""
        if self._law is not NO_LAW:
            command += self._law.stiffness * (self._law.anchor - self.x)
        self.asked.append((command, reference, rate, h))
        if self.arm is not None:
            self.arm.step()

    def take(self, x: float, v: float, flows: Flows) -> None:
        """Take where the arm's step has led."""
        self.x = x
        self.v = v
        self.hand_work += flows.hand_work
        own = flows.viscous_loss
        if self._law.damping > 0.0:
            own *= self.plant.viscous / self.acting.viscous
        self.motor_work += flows.motor_work - (flows.viscous_loss - own)
        self.grip_loss += flows.grip_loss
        self.viscous_loss += own
        self.coulomb_loss += flows.coulomb_loss
        self.environment_loss += flows.environment_loss
        self.given += flows.given

    def stored(self, reference: float) -> tuple[float, float, float]:
        """Return what the arm has got through this joint, grip and environment energy."""
        _, grip, environment = plant_stored(self.plant, self.x, self.v, reference)
        return self.given, grip, environment

    def forces(self, reference: float, rate: float) -> tuple[float, float]:
        """Return the efforts of hand and environment on the joint."""
        return plant_forces(self.plant, self.x, self.v, reference, rate)


class Outside(Protocol):
    """What acts on the tip of an arm."""

    def efforts(self, x: Sequence[float], v: Sequence[float], h: float) -> list[float]:
        """Return the joints' efforts over a step of `h` [s]."""
        ...

    def show(self, x: Sequence[float], v: Sequence[float]) -> None:
        """Look at the arm without moving it."""
        ...


class ArmPhysics:
    """An arm: the chain that couples its joints. A row source of its kinetic energy and height.

    `work` is what all joints gave; less kinetic energy and potential it is what the steps are
    wrong by.
    """

    def __init__(self, model: ArmModel, joints: Sequence[JointPhysics]) -> None:
        self._chain = model.chain
        self._joints = joints
        self._x = [joint.x for joint in joints]
        self._v = [0.0] * len(joints)
        self._before = list(self._v)
        self._place = place_chain(self._chain, self._plants(), self._x)
        self._bottom = self._place.potential
        self.outside: Outside | None = None
        self.columns = names(under(f"arm.{model.name}", ARM))

    def _plants(self) -> tuple[PlantParams, ...]:
        return tuple([joint.acting for joint in self._joints])

    def step(self) -> None:
        """Move all joints on, if all have asked."""
        if not all(joint.asked for joint in self._joints):
            return
        asked = [joint.asked.pop(0) for joint in self._joints]
        acting = [Acting(effort, reference, rate) for effort, reference, rate, _ in asked]
        span = asked[0][3]
        if self.outside is not None:
            pushed = self.outside.efforts(self._x, self._v, span)
            acting = [
                one._replace(effort=one.effort + b) for one, b in zip(acting, pushed, strict=True)
            ]
        guess = [2.0 * v - old for v, old in zip(self._v, self._before, strict=True)]
        x, v, flows, self._place = chain_step(
            self._chain, self._plants(), self._place, self._x, self._v, guess, acting, span
        )
        self._before, self._x, self._v = self._v, x, v
        for joint, at, speed, flow in zip(self._joints, x, v, flows, strict=True):
            joint.take(at, speed, flow)
        self.show()

    def show(self) -> None:
        """Show what acts on the tip where the arm is."""
        if self.outside is not None:
            self.outside.show(self._x, self._v)

    def fill(self, row: Row, at: int) -> None:
        """Write kinetic energy, height and the joints' work [J] from index `at` on."""
        row[at] = kinetic_energy(self._place.matrix, self._v)
        row[at + 1] = self._place.potential - self._bottom
        row[at + 2] = sum(joint.given for joint in self._joints)
