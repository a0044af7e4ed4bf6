"""What the next request sends: goals of current, velocity and position, by servo."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tautwave.types import AxisCommand
from tautwave_drivers.dynamixel.bringup import Limits
from tautwave_drivers.dynamixel.exchange import Goals
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.units import Scale


class Staging:
    """The goals of all servos on a line.

    Positions are sent from the first that is commanded on: until then a servo holds where torque
    found it.

    Parameters
    ----------
    servos, scales, limits : sequences
        Per axis the servo, its units and its greatest goals.
    """

    def __init__(
        self, servos: Sequence[Servo], scales: Sequence[Scale], limits: Sequence[Limits]
    ) -> None:
        currents: list[int] = []
        velocities: list[int] = []
        positions: list[int] = []
        for at, servo in enumerate(servos):
            follows = servo.axis.takes_position
            (positions if follows else currents if servo.impedance else velocities).append(at)
        self._goals: list[Goals] = []
        self._staged: list[tuple[int, Goals, int, Callable[[AxisCommand, int], int], int]] = []
        for register, some in ((reg.GOAL_CURRENT, currents), (reg.GOAL_VELOCITY, velocities)):
            if not some:
                continue
            goals = Goals(register, [servos[at].options.id for at in some])
            self._goals.append(goals)
            for place, at in enumerate(some):
                counts, limit = scales[at].velocity_counts, limits[at].velocity
                if register is reg.GOAL_CURRENT:
                    counts, limit = scales[at].current_counts, limits[at].current
                self._staged.append((at, goals, place, counts, limit))
        self._followers = [(at, scales[at].position_counts) for at in positions]
        self._places = Goals(reg.GOAL_POSITION, [servos[at].options.id for at in positions])
        self._placed = False

    def put(self, commands: Sequence[AxisCommand]) -> None:
        """Take one command per axis."""
        for at, goals, place, counts, limit in self._staged:
            goals.put(place, counts(commands[at], limit))
        if self._followers and all(
            math.isfinite(commands[at].position) for at, _ in self._followers
        ):
            for place, (at, count) in enumerate(self._followers):
                self._places.put(place, count(commands[at].position))
            self._placed = True

    def packet(self) -> bytes:
        """Return the sync writes."""
        goals = self._goals
        if self._placed:
            return b"".join(g.packet() for g in (*goals, self._places))
        return goals[0].packet() if len(goals) == 1 else b"".join(g.packet() for g in goals)

    def zero(self) -> None:
        """No current, no velocity; positions stay as they are."""
        self._placed = False
        for _, goals, place, _, _ in self._staged:
            goals.put(place, 0)
