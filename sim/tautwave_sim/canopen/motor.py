"""The motor of a drive: counts and per mille in front, the physics of a simulated axis behind.

Scales: CiA 402-2 v3.0 (6064h, 606Ch in increments, 6071h and 6077h in 1/1000 of 6076h). Effort is
taken through gear and feed without loss.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.canopen.options import NodeKeys

_SAME = 1e-9


class MotorScale(NamedTuple):
    """What one count is worth at the axis [SI], and -1 where the drive counts against it."""

    position: float
    velocity: float
    effort: float
    direction: int


def motor_scale(node: NodeKeys, kind: str, truth: AxisModel) -> MotorScale:
    """Return the scale of a drive on a `rotary` or `linear` axis.

    Where the truth names the same step but for the last digits, it is the truth's: the simulated
    encoder has exactly one count per step then.
    """
    travel = math.tau if kind == "rotary" or node.feed is None else node.feed
    position = travel / (node.counts_per_revolution * node.gear_ratio)
    effort = node.rated_torque / 1000.0 * node.gear_ratio * (math.tau / travel)
    position = _agreed(position, truth.encoder_quantum)
    effort = _agreed(effort, truth.effort_quantum)
    velocity = _agreed(position * node.velocity_factor, truth.velocity_quantum)
    return MotorScale(position, velocity, effort, node.direction)


def _agreed(own: float, truth: float) -> float:
    return truth if math.fabs(truth - own) <= _SAME * own else own


class DriveAxis(SimulatedAxis):
    """A simulated axis whose command may also change within a slot, as asynchronous PDOs do it."""

    def __init__(self, name: str, truth: AxisModel) -> None:
        super().__init__(name, truth)
        self._changes: list[tuple[float, float]] = []

    def change(self, value: float, share: float) -> None:
        """Take a command that acts from this share of the running slot on."""
        if share <= 0.0:
            self._changes.clear()
            self.command(value)
            return
        before = self._command
        self.command(value)
        self._changes.append((min(share, 1.0), self._command))
        self._command = before

    def pass_slot(self) -> None:
        """Move by one slot."""
        if not self._changes:
            super().pass_slot()
            return
        if self._pipe or self._late > 0.0:  # a drive that is slow itself takes it in the next
            super().pass_slot()
        else:
            reference, rate = self._hand
            begun, period = 0.0, self.period
            for share, value in (*self._changes, (1.0, self._changes[-1][1])):
                if share > begun:
                    before = reference + rate * begun * period
                    self.physics.step(self._command, before, rate, (share - begun) * period)
                    begun = share
                self._command = value
            self._arrive()
        self._command = self._changes[-1][1]
        self._changes.clear()


class Motor:
    """One simulated axis as its drive sees it.

    It is held still until `free` is set. Commands act from `share` of the running slot on.
    """

    def __init__(self, name: str, truth: AxisModel, scale: MotorScale) -> None:
        self.axis = DriveAxis(name, truth)
        self.scale = scale
        self.servo = truth.servo is not None
        self.period = truth.period
        self.mass = truth.plant.mass
        self.viscous = truth.plant.viscous
        self.lag = truth.servo.time_constant if truth.servo is not None else 0.0
        self.free = False
        self.share = 0.0
        self.origin_counts = 0
        """What homing has set position 0 to [counts]."""
        self.torque_counts = 0
        """What acts on an impedance axis."""
        self.velocity_reported = 0.0
        self.valid = True
        """Whether this slot's sample is there to be sent."""
        self._measured: float | None = None
        self._effort = 0.0

    def pass_slot(self) -> None:
        """Move by one slot, unless it is held."""
        self.share = 0.0
        if self.free:
            self.axis.pass_slot()
            self._measured = None

    def measure(self) -> float:
        """Sample encoder and force, once per slot; return the position."""
        if not self.free:
            return self.axis.physics.x  # not sampled yet: no random number is used
        if self._measured is None:
            state = self.axis.measure()
            self._measured, self.valid = state.position, state.valid
            self._effort = state.effort if self.servo or self.axis.sensor is not None else 0.0
        return self._measured

    @property
    def position_counts(self) -> int:
        """6064h."""
        counts = math.floor(self.measure() / self.scale.position + 0.5)
        return self.scale.direction * counts - self.origin_counts

    @property
    def velocity_counts(self) -> int:
        """606Ch."""
        speed = self.axis.physics.v if self.free else 0.0
        return self.scale.direction * math.floor(speed / self.scale.velocity + 0.5)

    @property
    def actual_torque_counts(self) -> int:
        """6077h: the motor's torque; of a servo what it holds against hand and environment."""
        if not self.servo:
            return self.torque_counts
        self.measure()
        return -self.scale.direction * math.floor(self._effort / self.scale.effort + 0.5)

    def sensor_counts(self, effort: float, zero: int) -> int:
        """Return what an analogue input shows of the effort sensor: counts of `effort` each."""
        self.measure()
        return zero + math.floor(self._effort / effort + 0.5)

    def velocity(self) -> float:
        """Return the speed [rad/s or m/s], as a fine encoder would show it."""
        return self.axis.physics.v if self.free else 0.0

    def position(self) -> float:
        """Return the position [rad or m], as a fine encoder would show it."""
        return self.axis.physics.x

    def drive_torque(self, counts: int) -> None:
        """Let per mille of the rated torque act."""
        self.torque_counts = counts
        self.axis.change(self.scale.direction * counts * self.scale.effort, self.share)

    def drive_velocity(self, velocity: float) -> None:
        """Let a servo follow a velocity [rad/s or m/s]."""
        self.velocity_reported = velocity
        self.axis.change(velocity, self.share)

    def position_of(self, counts: int) -> float:
        """Return the position [rad or m] of counts in 607Ah."""
        return self.scale.direction * (counts + self.origin_counts) * self.scale.position

    def velocity_of(self, counts: int) -> float:
        """Return the velocity [rad/s or m/s] of counts in 60FFh."""
        return self.scale.direction * counts * self.scale.velocity
