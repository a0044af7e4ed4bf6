"""Counts of one servo and SI of the axis that it moves.

Signs: the axis turns with the servo (`direction` 1) or against it (-1). The effort of a
`JointState` is what the outside does to the device. An axis in velocity mode measures it as the
motor's current: at rest the motor holds against the outside, so effort = - current * torque
constant. It is not a force sensor: friction and the gear's inertia are in it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.types import AxisCommand
from tautwave_drivers.dynamixel.options import Servo
from tautwave_drivers.dynamixel.protocol.models import COUNTS_PER_TURN, LOAD_UNIT, VELOCITY_UNIT
from tautwave_drivers.turns import doubt, turns_back

CURRENT_RANGE = 32_767


class Scale(NamedTuple):
    """What one count of a servo is at its axis [rad or m, rad/s or m/s, N m or N]."""

    position: float
    velocity: float
    effort: float
    direction: int
    zero_counts: int

    def current_counts(self, command: AxisCommand, limit: int = CURRENT_RANGE) -> int:
        """Return the goal current nearest to an effort, at most `limit`; 0 where not finite."""
        return self.direction * _nearest(command.effort / self.effort, limit)

    def velocity_counts(self, command: AxisCommand, limit: int = 2**31 - 1) -> int:
        """Return the goal velocity nearest to a velocity, at most `limit`; 0 where not finite."""
        return self.direction * _nearest(command.velocity / self.velocity, limit)

    def position_counts(self, position: float) -> int:
        """Return the goal position nearest to a finite position."""
        return self.zero_counts + self.direction * math.floor(position / self.position + 0.5)


def whole_turns(scale: Scale, counts: int, position_range: tuple[float, float]) -> int | None:
    """Return the whole turns of a servo that have to be taken off its counts.

    0 where it is within its range, or no whole turns bring it there; None where several do.
    """
    position = scale.direction * (counts - scale.zero_counts) * scale.position
    geared = math.tau / (COUNTS_PER_TURN * scale.position)
    low, high = (geared * end for end in position_range)
    back = turns_back(geared * position, (low, high))
    if not back or back[0] == 0:
        return 0
    return -scale.direction * back[0] if len(back) == 1 else None


def doubt_of(scale: Scale, counts: int, position_range: tuple[float, float]) -> str:
    """Return which other whole turns of a servo its range leaves open; empty where none."""
    position = scale.direction * (counts - scale.zero_counts) * scale.position
    return doubt(position, position_range, COUNTS_PER_TURN * scale.position)


def scale_of(servo: Servo) -> Scale:
    """Return the units of a servo at its axis."""
    gear = servo.options.gear_ratio
    if servo.model.current_unit > 0.0:
        effort = servo.model.current_unit * servo.torque_constant
    else:
        effort = LOAD_UNIT * servo.model.stall_torque
    if servo.options.shadow is not None or servo.obeys is not None:
        effort *= 2.0  # two motors follow the same goal
    return Scale(
        position=2.0 * math.pi / COUNTS_PER_TURN / gear,
        velocity=VELOCITY_UNIT / gear,
        effort=effort * gear,
        direction=servo.options.direction,
        zero_counts=servo.options.zero_counts,
    )


def _nearest(count: float, limit: int) -> int:
    if -limit <= count <= limit:
        return math.floor(count + 0.5)
    if not math.isfinite(count):
        return 0  # NaN or infinite
    return limit if count > 0.0 else -limit
