"""The motor of a servo: from the registers to the command of its axis, slot by slot.

Current is torque (constant slope); velocity and position are small loops around it, not ROBOTIS'
own PID: they reach the goal, which is what others' software waits for. Temperature is one thermal
mass, heated by the square of the current; an overload is a current near stall that does not move.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.truth import AxisModel
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.dynamixel.items import Model
from tautwave_sim.dynamixel.memory import Memory

CURRENT, VELOCITY, POSITION, EXTENDED, CURRENT_POSITION, PWM = 0, 1, 3, 4, 5, 16
VOLTAGE_BIT, OVERHEAT_BIT, ENCODER_BIT, SHOCK_BIT, OVERLOAD_BIT = 0, 2, 3, 4, 5

LOAD_UNIT = 0.001
PWM_FULL = 885
REV_PER_MIN = math.tau / 60.0
PROFILE_ACCELERATION_UNIT = 214.577 * math.tau / 3600.0
"""[rad/s2] 214.577 rev/min2."""

FOLLOW = 12.0
"""[1/s] Velocity demand per position error."""
SETTLE = 5.0
"""Periods in which the velocity loop removes its error."""


class Joint(NamedTuple):
    """Between counts of the servo and SI of the axis it moves.

    `position`, `velocity` and `effort` are one count in [rad or m], [rad/s or m/s], [N m or N].
    """

    position: float
    velocity: float
    effort: float
    direction: int
    zero: int

    def to_counts(self, x: float) -> int:
        """Return the position in counts of a position of the axis."""
        return self.zero + self.direction * math.floor(x / self.position + 0.5)

    def to_position(self, counts: int) -> float:
        """Return the position of the axis at these counts."""
        return self.direction * (counts - self.zero) * self.position


class Heat(NamedTuple):
    """One thermal mass: [degC] around it, [K] warmer at stall current after a while, that while."""

    ambient_c: float = 25.0
    rise_k: float = 60.0
    time_s: float = 120.0


class Motor:
    """What a servo's registers make of its axis."""

    def __init__(
        self, model: Model, memory: Memory, axis: SimulatedAxis, truth: AxisModel, joint: Joint
    ) -> None:
        self.model = model
        self.memory = memory
        self.axis = axis
        self.joint = joint
        self.heat = Heat()
        self.temperature_c = self.heat.ambient_c
        self.voltage = model.voltage
        self.overload_share = 0.9
        self.overload_s = 1.0
        self._admittance = truth.servo is not None
        self._mass = truth.plant.mass
        self._viscous = truth.plant.viscous
        self._period = truth.period
        self._loop_effort = 0.0
        self._overload_time = 0.0
        self._stall_counts = 1000.0
        if model.current_unit_a:
            self._stall_counts = model.stall_current / model.current_unit_a
        self._no_load = model.no_load_speed_rpm / model.velocity_unit_rpm * joint.velocity
        self.current_counts = 0
        self.trajectory = axis.physics.x
        self.trajectory_velocity = 0.0
        self.target = axis.physics.x
        self.torque_on = False
        self.mode = POSITION
        self.commanded = 0.0
        self.configure()

    def configure(self) -> None:
        """Apply what was written to the registers."""
        memory = self.memory
        on = memory.peek("Torque Enable") == 1
        if self.model.protocol < 2.0:
            wheel = memory.peek("CW Angle Limit") == memory.peek("CCW Angle Limit") == 0
            mode = VELOCITY if wheel else POSITION
        else:
            mode = memory.peek("Operating Mode")
        if (on and not self.torque_on) or mode != self.mode:
            self._loop_effort = 0.0
            self.trajectory = self.target = self.axis.physics.x
            self.trajectory_velocity = 0.0
            if on:
                memory.poke("Goal Position", self.position_counts())
        self.torque_on = on
        self.mode = mode
        self._goals()
        if not on:
            self.command()

    def _goals(self) -> None:
        memory, joint = self.memory, self.joint
        self.goal_current = 0
        if memory.has("Goal Current"):
            limit = memory.peek("Current Limit")
            self.goal_current = max(-limit, min(limit, memory.peek("Goal Current")))
        if self.model.protocol < 2.0:
            speed = memory.peek("Moving Speed")
            size = speed & 0x3FF
            self.goal_velocity = (
                joint.direction * joint.velocity * (-size if speed > 1023 else size)
            )
            self._fastest = size * joint.velocity if size else self._no_load
            self._acceleration = math.inf
            self._share = memory.peek("Torque Limit") / 1023
        else:
            self.goal_velocity = joint.direction * joint.velocity * memory.peek("Goal Velocity")
            fastest = memory.peek("Profile Velocity") or memory.peek("Velocity Limit")
            self._fastest = fastest * joint.velocity
            steps = memory.peek("Profile Acceleration")
            per_count = PROFILE_ACCELERATION_UNIT * joint.velocity / (0.229 * REV_PER_MIN)
            self._acceleration = steps * per_count if steps else math.inf
            self._share = abs(memory.peek("Goal PWM")) / PWM_FULL
        if self.torque_on:
            self.target = joint.to_position(memory.peek("Goal Position"))

    def goal_written(self, name: str, value: int) -> None:
        """Apply one goal, quickly."""
        if name == "Goal Current":
            limit = self.memory.peek("Current Limit")
            self.goal_current = max(-limit, min(limit, value))
        elif name == "Goal Velocity":
            self.goal_velocity = self.joint.direction * self.joint.velocity * value
        else:
            self._goals()
        if self.mode in (CURRENT, VELOCITY) and (self._admittance or self.mode == CURRENT):
            self.command()  # known at once; it acts from the next slot on

    def clear_goals(self) -> None:
        """Stop: what a tripped bus watchdog does.

        The PWM and the current that hold a position stay: without them it would coast.
        """
        self.memory.poke("Goal Velocity", 0)
        if self.mode == PWM:
            self.memory.poke("Goal PWM", 0)
        if self.mode != CURRENT_POSITION:
            self.memory.poke("Goal Current", 0)
        self.memory.poke("Goal Position", self.position_counts())
        self._goals()
        self.trajectory = self.target = self.axis.physics.x
        self.trajectory_velocity = 0.0

    def position_counts(self) -> int:
        """Return where the axis is, in counts, without noise."""
        return self.joint.to_counts(self.axis.physics.x)

    # ------------------------------------------------------------------------------- a slot

    def command(self) -> None:
        """Give the axis the command of the coming slot."""
        if not self.torque_on:
            self.commanded = 0.0
        elif self._admittance:
            self.commanded = self._velocity_wanted()
        elif self.mode == CURRENT:
            self.commanded = float(self.joint.direction * self.goal_current) * self.joint.effort
        elif self.mode == PWM:
            self.commanded = self._voltage_effort()
        else:
            self.commanded = self._held_effort(self._velocity_wanted())
        self.axis.command(self.commanded)

    def passed(self) -> int:
        """Account for the slot that has passed; return the bits of hardware errors it brought."""
        self._measure_current()
        share = abs(self.current_counts) / self._stall_counts
        next_state = self.heat.ambient_c + self.heat.rise_k * share * share
        self.temperature_c += (next_state - self.temperature_c) * self._period / self.heat.time_s
        stuck = abs(self.axis.physics.v) < 0.05 * self._no_load
        if share >= self.overload_share and stuck and self.torque_on:
            self._overload_time += self._period
        else:
            self._overload_time = 0.0
        bits = 0
        if self._overload_time >= self.overload_s:
            bits |= 1 << OVERLOAD_BIT
        if self.temperature_c > self.memory.peek("Temperature Limit"):
            bits |= 1 << OVERHEAT_BIT
        if not self._voltage_fine():
            bits |= 1 << VOLTAGE_BIT
        return bits

    def _voltage_fine(self) -> bool:
        low, high = self.memory.peek("Min Voltage Limit"), self.memory.peek("Max Voltage Limit")
        return low <= self.voltage * 10.0 + 1e-6 and self.voltage * 10.0 <= high + 1e-6

    def _measure_current(self) -> None:
        """Set what the servo reports as its current (or load): the torque that the motor gives."""
        if not self.torque_on:
            self.current_counts = 0
        elif self._admittance:
            reference, rate = self.axis.hand()
            self.hold_against(sum(self.axis.physics.forces(reference, rate)))
        elif self.mode == CURRENT:
            self.current_counts = self.goal_current
        else:
            self.current_counts = self.joint.direction * math.floor(
                self.commanded / self.joint.effort + 0.5
            )

    def hold_against(self, outside: float) -> None:
        """Draw the current that holds an outside effort; only an admittance axis does."""
        if self._admittance and self.torque_on and math.isfinite(outside):
            counts = math.floor(outside / self.joint.effort + 0.5)
            self.current_counts = -self.joint.direction * counts

    def _velocity_wanted(self) -> float:
        if self.mode == VELOCITY or self.mode in (CURRENT, PWM):
            return self.goal_velocity
        self._follow_profile()
        missing = self.trajectory - self.axis.physics.x
        return self.trajectory_velocity + FOLLOW * missing

    def _follow_profile(self) -> None:
        period = self._period
        missing = self.target - self.trajectory
        wanted = missing / period
        if math.isfinite(self._acceleration):
            # No faster than what this deceleration still stops within the distance left.
            stop = math.sqrt(2.0 * self._acceleration * abs(missing))
            wanted = max(-stop, min(stop, wanted))
        wanted = max(-self._fastest, min(self._fastest, wanted))
        change = self._acceleration * period
        before = self.trajectory_velocity
        self.trajectory_velocity = max(before - change, min(before + change, wanted))
        self.trajectory += self.trajectory_velocity * period
        if abs(missing) < 1e-9:
            self.trajectory_velocity = 0.0

    def _held_effort(self, velocity: float) -> float:
        missing = velocity - self.axis.physics.v
        gain = self._mass / (SETTLE * self._period)
        limit = self._stall_counts * self.joint.effort * self._share
        if self.mode == CURRENT_POSITION:
            limit = min(limit, abs(self.goal_current) * self.joint.effort)
        self._loop_effort += 0.1 * gain * missing
        self._loop_effort = max(-limit, min(limit, self._loop_effort))
        effort = gain * missing + self._viscous * velocity + self._loop_effort
        return max(-limit, min(limit, effort))

    def _voltage_effort(self) -> float:
        duty = self.joint.direction * self.memory.peek("Goal PWM") / PWM_FULL
        stall = self._stall_counts * self.joint.effort
        return stall * (duty - self.axis.physics.v / self._no_load)

    def duty(self) -> int:
        """Return the PWM that the torque needs at this speed [0.113 %]."""
        if not self.torque_on:
            return 0
        turning = self.joint.direction * self.axis.physics.v / self._no_load
        share = self.current_counts / self._stall_counts + turning
        return max(-PWM_FULL, min(PWM_FULL, round(PWM_FULL * share)))
