"""The motor of a drive: counts in front, the physics of a simulated axis behind."""

from __future__ import annotations

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.modbus.units import Scale, to_counts

LOOP = 0.2
"""Share of its distance that a servo in position mode goes in a slot."""


class Motor:
    """One simulated axis as its drive sees it, sample by sample.

    It is held where it is until `free` is set. A command acts from the present slot on.
    """

    def __init__(self, name: str, truth: AxisModel, scale: Scale) -> None:
        self.axis = SimulatedAxis(name, truth)
        self.scale = scale
        self.servo = truth.servo is not None
        self.free = False
        self.valid = True
        """Whether the sample of this slot is there to be sent."""
        self.position_counts = 0
        self.velocity_counts = 0
        self.torque_counts = 0
        """The motor's own; of a servo what it holds against hand and environment."""
        self.setpoint = 0
        """Commanded torque, or velocity of a servo [counts]."""
        self._outside = 0.0
        self._latch(self.axis.physics.x, 0.0, 0.0)

    def pass_slot(self) -> None:
        """Move by one slot, unless it is held."""
        if self.free:
            self.axis.pass_slot()

    def latch(self) -> None:
        """Sample; once a slot, since it uses random numbers."""
        if not self.free:
            return
        state = self.axis.measure()
        self.valid = state.valid
        self._outside = state.effort if self.axis.sensor is not None else 0.0
        self._latch(state.position, self.axis.physics.v, state.effort if self.servo else 0.0)

    def _latch(self, position: float, velocity: float, effort: float) -> None:
        scale = self.scale
        self.position_counts = scale.direction * to_counts(position, scale.position)
        self.velocity_counts = scale.direction * to_counts(velocity, scale.velocity)
        if self.servo:
            self.torque_counts = -scale.direction * to_counts(effort, scale.effort)
        else:
            self.torque_counts = self.setpoint

    def sensor_counts(self, effort: float, zero: int) -> int:
        """Return what an analogue input shows of the effort sensor: counts of `effort` each."""
        return zero + to_counts(self._outside, effort)

    def command(self, counts: int) -> None:
        """Follow a torque, or as a servo a velocity [counts]."""
        self.setpoint = counts
        quantum = self.scale.velocity if self.servo else self.scale.effort
        self.axis.command(self.scale.direction * counts * quantum)

    def approach(self, counts: int) -> None:
        """Go towards a position as a servo [counts], for one slot."""
        target = self.scale.direction * counts * self.scale.position
        self.axis.command(LOOP * (target - self.axis.physics.x) / self.axis.period)
        self.setpoint = 0
