"""A driver whose axes are the coordinates of an arm's tip; behind it another one, of the joints.

Efforts on the coordinates are held by the joints' J^T F, J taken where the arm will be half-way
through the period in which they act; beside them go the arm's weight, its posture spring and walls.
Each has books of its own, from the displacements measured and the efforts that acted: `given` of
the tip is what the joints got beyond the energy that the controller's own books have, F times the
displacement of the coordinates.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tautwave.columns import names, under
from tautwave.contracts import BusSpec, Clock, Row
from tautwave.models.chain.task import COORDINATES, home_place, joint_efforts, task_place
from tautwave.types import SAFE_COMMAND, AxisCommand, JointState
from tautwave_drivers.arm.behind import JointsBehind
from tautwave_drivers.arm.columns import EFFORT, OF_EFFORTS, POSITION, WALL
from tautwave_drivers.arm.options import ArmOptions
from tautwave_drivers.arm.parts import Effort, TipWall


class ArmDriver(JointsBehind):
    """The driver of an arm whose joints take efforts; a row source."""

    def __init__(self, options: ArmOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        super().__init__(options, bus, clock, transport)
        self._home = options.at_home
        self._origin = home_place(self._task)
        self._carry = options.carry
        self._posture = options.posture
        late = self.command_delay.remainder_s / self._period
        self._ahead = 0.5 + self.command_delay.periods + late
        self._softness = [1.0 / joint.inertia_lower for joint in options.joints.values()]
        count = self._count
        noise = [
            joint.position_noise**2 + joint.encoder_quantum**2 / 12.0
            for joint in options.joints.values()
        ]
        periods = self.command_delay.periods
        self._tip = Effort(COORDINATES + count, periods, late)
        self._held = Effort(count, periods, late)
        self._walls = [
            TipWall(name, wall, noise, Effort(count, periods, late), self._softness, self._period)
            for name, wall in options.walls.items()
        ]
        self._parts = (self._tip, self._held, *(wall.effort for wall in self._walls))
        self._mapped = self._most = 0.0
        self._carried = self._least = self._potential = 0.0
        self._start: float | None = None
        self.columns = [f"joints.{axis.name}.{POSITION.name}" for axis in self._joints]
        self.columns += [f"joints.{axis.name}.{EFFORT.name}" for axis in self._joints]
        self.columns += names(under(f"tip.{bus.name}", OF_EFFORTS))
        for wall in self._walls:
            self.columns += names(under(f"space.{bus.name}.{wall.name}", WALL))

    def open(self) -> None:
        """Open the joints' bus; no earlier effort acts any more."""
        for part in self._parts:
            part.drop()
        self._start = None
        super().open()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the tip's coordinates, valid where every joint has a sample; close the books."""
        states, slots = self._sampled(deadline_ns)
        for part in self._parts:
            part.pass_slots(slots)
        if not all(state.valid and math.isfinite(state.position) for state in states):
            return self._missed(states)
        self._take([state.position for state in states])
        place = self._place
        age = max((state.age_ns for state in states), default=0)
        return [JointState(place[k], math.nan, math.nan, True, age) for k in self._which]

    def _take(self, q: list[float]) -> None:
        """Take all joints' positions, and book what acted since the last."""
        place = list(task_place(self._task, q, self._jacobian))
        slots = self._tip.slots
        if self._known and slots:
            moved = [a - b for a, b in zip(q, self._q, strict=True)]
            self._stride = [step / slots for step in moved]
            change = [a - b for a, b in zip(place, self._place, strict=True)]
            self._mapped += self._tip.work([*change, *moved])
            self._most = max(self._most, self._mapped)
            self._carried -= self._held.work(moved)
            for wall in self._walls:
                wall.close(moved)
            self._watch(q)
        self._known = True
        self._q = q
        self._place = place
        for part in self._parts:
            part.begin()
        _, height = self._weight(q)
        if self._start is None:
            # What moved while the devices were reset is no work of theirs.
            self._start = height - self._potential
        self._potential = height - self._start
        self._least = min(self._least, self._carried + self._potential)

    def _weight(self, q: Sequence[float]) -> tuple[list[float], float]:
        """Return what holds weight and posture at `q`, and the potential of both [J]."""
        held, height = [0.0] * self._count, 0.0
        if self._carry:
            held, height = self._weighs(q)
        if self._posture > 0.0:
            for j, home in enumerate(self._home):
                off = q[j] - home
                held[j] -= self._posture * off
                height -= 0.5 * self._posture * off * off
        return held, height

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Hold the efforts on the coordinates by the joints; a safe command stays what it is."""
        if not self._known or all(command is SAFE_COMMAND for command in commands):
            self._rest()
            return
        forces = [0.0] * COORDINATES
        if not self._dead:
            for k, command in zip(self._which, commands, strict=True):
                forces[k] = command.effort
        count, ahead = self._count, self._ahead
        soon = [at + ahead * step for at, step in zip(self._q, self._stride, strict=True)]
        jacobian = [0.0] * (COORDINATES * count)
        place = task_place(self._task, soon, jacobian)
        mapped = [0.0] * count
        joint_efforts(jacobian, forces, mapped)
        held, _ = self._weight(soon)
        if self._dead:
            held = [
                0.0 if joint.name in self._dead else own
                for joint, own in zip(self._joints, held, strict=True)
            ]
        beside = list(held)
        tip = [at + home for at, home in zip(place, self._origin, strict=False)]
        for wall in self._walls:
            pushed = wall.push(tip, jacobian, self._stride, dead=bool(self._dead))
            for j, effort in enumerate(pushed):
                beside[j] += effort
        self._held.set(held)
        self._sent = self._within(mapped, beside)
        # What the controller believes enters with the other sign: `work` is then the difference.
        believed = [0.0] * COORDINATES
        for k, command in zip(self._which, commands, strict=True):
            believed[k] = -command.effort
        self._tip.set([*believed, *mapped])
        self._driver.write([AxisCommand(effort, 0.0) for effort in self._sent])

    def _within(self, mapped: list[float], beside: list[float]) -> list[float]:
        """Return all efforts within the joints' limits; `mapped` shrinks as a whole if it must."""
        share = 1.0
        for joint, effort, other in zip(self._joints, mapped, beside, strict=True):
            room = joint.effort_limit - math.copysign(1.0, effort) * other  # that way
            if effort != 0.0 and abs(effort) > room:
                share = min(share, max(room, 0.0) / abs(effort))
        if share < 1.0:
            mapped[:] = [share * effort for effort in mapped]
        return [
            min(max(effort + other, -joint.effort_limit), joint.effort_limit)
            for joint, effort, other in zip(self._joints, mapped, beside, strict=True)
        ]

    def _rest(self) -> None:
        """Send the safe command."""
        for part in self._parts:
            part.set([0.0] * part.size)
        self._sent = [0.0] * self._count
        self._driver.write([SAFE_COMMAND] * self._count)

    def fill(self, row: Row, at: int) -> None:
        """Write joints, books and walls."""
        for value in self._q:
            row[at] = value
            at += 1
        for value in self._sent:
            row[at] = value
            at += 1
        leak = self._carried + self._potential
        for value in (self._mapped, self._most, self._potential, leak, -self._least):
            row[at] = value
            at += 1
        for wall in self._walls:
            at = wall.fill(row, at)
