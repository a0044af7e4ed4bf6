"""A driver of the tip of an arm whose joints follow velocities and measure efforts.

What acts on the joints, their weight taken off, becomes the effort on the coordinates; velocities
of the coordinates become the joints', by `laws.space.damped`. Near a singular pose the tip lags,
and what it then gives out beyond the controller's books is gated: as far as the reserve goes.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Any

from tautwave.columns import names, under
from tautwave.contracts import BusSpec, Clock, Row
from tautwave.laws.space.damped import damped_inverse, room_for
from tautwave.models.chain.task import COORDINATES, task_place
from tautwave.types import SAFE_COMMAND, AxisCommand, JointState
from tautwave_drivers.arm.behind import JointsBehind
from tautwave_drivers.arm.columns import OF_VELOCITIES, POSITION, VELOCITY
from tautwave_drivers.arm.options import ArmOptions

TURN_LENGTH = 0.2
"""[m] Lever at which a turn of the tip counts as a way, where both are compared."""

SPEED_SHARE = 0.9
"""Of its velocity limit that a joint is asked for at most."""

OVERDRAWN = 2.0
"""Times the reserve that may be given out before the run is stopped."""


class FollowingArm(JointsBehind):
    """The driver of such an arm; a row source.

    `mapped` is what the joints gave out beyond the books of the controller, the mean effort on the
    coordinates times their displacement, both from the same samples.
    """

    def __init__(self, options: ArmOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        super().__init__(options, bus, clock, transport)
        self._carry = options.carry
        self._floor = options.least_lever
        self._reserve = options.reserve
        size = len(self._which)
        self._scales = [1.0 if k < 3 else TURN_LENGTH for k in self._which]
        self._own = [float(i == j) for i in range(size) for j in range(size)]
        self._led: list[list[float]] = []
        self._gain: list[float] = []
        self._lever = 0.0
        self._effort = [0.0] * size
        self._torque = [0.0] * self._count
        self._mapped = self._most = 0.0
        self._allowed = 1.0
        self._granted = options.reserve
        self._slots = 0  # since the last sample
        # What commands may give that do not act yet, or that no sample has shown yet.
        delay = self.command_delay
        self._waiting = deque([0.0] * (delay.periods + (delay.remainder_s > 0.0)))
        self._unseen = 0.0
        self.columns = [f"joints.{axis.name}.{POSITION.name}" for axis in self._joints]
        self.columns += [f"joints.{axis.name}.{VELOCITY.name}" for axis in self._joints]
        self.columns += names(under(f"tip.{bus.name}", OF_VELOCITIES))

    def open(self) -> None:
        """Open the joints' bus, with the whole reserve."""
        self._granted = max(self._mapped, 0.0) + self._reserve
        self._waiting = deque([0.0] * len(self._waiting))
        super().open()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return coordinates and efforts, valid where every joint has both; close the books."""
        states, slots = self._sampled(deadline_ns)
        self._slots += slots
        if not all(
            state.valid and math.isfinite(state.position) and math.isfinite(state.effort)
            for state in states
        ):
            return self._missed(states)
        self._take([state.position for state in states], [state.effort for state in states])
        age = max((state.age_ns for state in states), default=0)
        return [
            JointState(self._place[k], math.nan, effort, True, age)
            for k, effort in zip(self._which, self._effort, strict=True)
        ]

    def _take(self, q: list[float], torque: list[float]) -> None:
        """Take all joints' positions and efforts, and book what acted since the last."""
        jacobian = self._jacobian
        place = list(task_place(self._task, q, jacobian))
        if self._carry:
            held, _ = self._weighs(q)
            torque = [effort + own for effort, own in zip(torque, held, strict=True)]
        joints = range(0, COORDINATES * self._count, COORDINATES)
        self._led = [[jacobian[j + k] for j in joints] for k in self._which]
        flat = [slope for row in self._led for slope in row]
        self._gain, self._lever = damped_inverse(flat, self._own, self._scales, self._floor)
        pushed = [sum(map(_times, row, torque)) for row in self._led]
        effort = self._gained(pushed)
        if self._known and self._slots:
            moved = [a - b for a, b in zip(q, self._q, strict=True)]
            self._stride = [step / self._slots for step in moved]
            booked = sum(
                0.5 * (now + then) * (place[k] - self._place[k])
                for k, now, then in zip(self._which, effort, self._effort, strict=True)
            )
            taken = sum(
                0.5 * (now + then) * step
                for now, then, step in zip(torque, self._torque, moved, strict=True)
            )
            self._mapped += booked - taken
            self._most = max(self._most, self._mapped)
            self._watch(q)
            # A NaN in the account counts as overdrawn.
            if not self._mapped <= self._granted + (OVERDRAWN - 1.0) * self._reserve:
                self._fail(
                    f"the arm supplied {self._mapped:.3g} J beyond what its tip's ports account "
                    f"for; its reserve is {self._reserve:g}"
                )
        self._known = True
        self._slots = 0
        self._unseen = 0.0
        self._q, self._place, self._torque, self._effort = q, place, torque, effort

    def _gained(self, values: Sequence[float]) -> list[float]:
        """Return G times what each coordinate has."""
        size = len(values)
        return [
            sum(map(_times, self._gain[i * size : (i + 1) * size], values)) for i in range(size)
        ]

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Lead the joints so that the coordinates go as commanded, as far as they may."""
        safe = all(command is SAFE_COMMAND for command in commands)
        if not self._known or self._dead or safe:
            self._sent = [0.0] * self._count
            self._file(0.0)
            self._driver.write([SAFE_COMMAND] * self._count)
            return
        wanted = [command.velocity for command in commands]
        through = self._gained(wanted)
        speeds = [0.0] * self._count
        for row, part in zip(self._led, through, strict=True):
            for j, slope in enumerate(row):
                speeds[j] += slope * part
        share = 1.0
        for joint, speed in zip(self._joints, speeds, strict=True):
            most = SPEED_SHARE * joint.velocity_limit
            if abs(speed) > most:
                share = min(share, most / abs(speed))
        lag = sum(
            effort * (sum(map(_times, row, speeds)) - speed)
            for effort, row, speed in zip(self._effort, self._led, wanted, strict=True)
        )
        gift = share * self._period * lag
        given = self._mapped + self._unseen + sum(self._waiting)
        self._allowed = room_for(given, gift, self._granted)
        self._file(max(self._allowed * gift, 0.0))
        share = share * self._allowed
        # A NaN speed is not sent.
        self._sent = [share * speed if share > 0.0 else 0.0 for speed in speeds]
        self._driver.write([AxisCommand(0.0, speed) for speed in self._sent])

    def _file(self, gift: float) -> None:
        """Keep what a command may give [J] until a sample shows what it gave."""
        self._waiting.append(gift)
        self._unseen += self._waiting.popleft()

    def fill(self, row: Row, at: int) -> None:
        """Write joints and books."""
        for value in (*self._q, *self._sent):
            row[at] = value
            at += 1
        for value in (self._mapped, self._most, self._lever, self._allowed):
            row[at] = value
            at += 1


def _times(one: float, other: float) -> float:
    return one * other
