"""From torque off to the rig's own mode, one non-blocking step per cycle: home, move, enable."""

from __future__ import annotations

import struct

from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.mapping import RPDO_2
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.cia402.modes import Homing as HomingSteps
from tautwave_drivers.cia402.modes import Mode

_TARGET = struct.Struct("<i")
_GAIN_PER_S = 5.0
_NEAR_COUNTS = 3
_STAY_S = 0.1
"""How long an axis has to stay near its goal: it may overshoot first."""


class StartUp:
    """Brings one drive to its mode; `failure` gives the reason if it did not.

    `second_pdo` has to be sent besides the cyclic RPDO: the target of a move.
    """

    def __init__(self, axis: Axis, options: CanopenOptions, period_ns: int) -> None:
        self._axis = axis
        self._period_s = period_ns * 1e-9
        self._can_id = RPDO_2 + axis.node.id
        self.reset()

    def reset(self) -> None:
        """Start over."""
        node = self._axis.node
        self._phases = [
            phase
            for phase, wanted in (("home", node.homing), ("move", node.move))
            if wanted is not None
        ]
        self._homing = HomingSteps()
        self._begun: int | None = None
        self._goal_counts = 0.0
        self._stayed = 0
        self.second_pdo: tuple[int, bytes] | None = None
        self.failure = ""
        self.faulted = False
        """Whether the drive itself reported the failure."""

    @property
    def done(self) -> bool:
        """Whether the drive is enabled in the rig's mode."""
        machine = self._axis.machine
        own = machine.mode_wanted == self._axis.mode
        return not self._phases and own and machine.commanding

    def step(self, cycle: int) -> None:
        """Set the goal of this cycle."""
        axis = self._axis
        axis.mode_bits = 0
        self.second_pdo = None
        if not self._phases:
            axis.enable(axis.mode)
            return
        if self._begun is None:
            self._begun = cycle
        phase = self._phases[0]
        finished = self._home(cycle) if phase == "home" else self._move(cycle)
        if finished:
            self._phases.pop(0)
            self._begun = None

    def _expired(self, cycle: int, limit_s: float, what: str) -> None:
        if self._begun is not None and (cycle - self._begun) * self._period_s > limit_s:
            self.failure = f"{self._axis.label}: {what} took more than {limit_s:g} s"

    def _home(self, cycle: int) -> bool:
        axis, keys = self._axis, self._axis.node.homing
        assert keys is not None
        axis.enable(Mode.HM)
        if axis.machine.commanding and axis.statusword >= 0:
            axis.mode_bits = self._homing.step(axis.statusword)
            axis.force_step()
        if self._homing.failed:
            self.failure = f"{axis.label}: homing error (statusword bit 13), method {keys.method}"
            self.faulted = True
            return False
        self._expired(cycle, keys.timeout_s, f"homing by method {keys.method}")
        return self._homing.done

    def _move(self, cycle: int) -> bool:
        """Go to the start position at constant velocity."""
        axis, keys = self._axis, self._axis.node.move
        assert keys is not None
        cyclic = keys.mode == "csp"
        axis.enable(Mode.CSP if cyclic else Mode.PV)
        self._expired(cycle, keys.timeout_s, f"moving to {keys.position:g}")
        if len(axis.reported) < 2:
            return False
        here = axis.reported[1]
        there = axis.node.direction * round(keys.position / axis.scale.encoder_quantum)
        left = there - here
        fastest = keys.velocity / axis.scale.encoder_quantum  # counts/s
        if not axis.machine.commanding:
            self._goal_counts = float(here)
        near = max(_NEAR_COUNTS, fastest * self._period_s)
        inside = axis.machine.commanding and abs(left) <= near
        self._stayed = self._stayed + 1 if inside else 0
        arrived = self._stayed * self._period_s >= _STAY_S
        if cyclic:
            rest = there - self._goal_counts
            stride = fastest * self._period_s if axis.machine.commanding else 0.0
            self._goal_counts += max(-stride, min(stride, rest))
            target = round(self._goal_counts)
        else:
            wanted = max(-fastest, min(fastest, _GAIN_PER_S * left))
            ratio = axis.scale.encoder_quantum / axis.scale.velocity_quantum
            running = axis.machine.commanding and not arrived
            target = round(wanted * ratio) if running else 0
        if axis.servo and not cyclic:
            axis.values[1] = target  # 60FFh is in the cyclic RPDO already
        else:
            self.second_pdo = (self._can_id, _TARGET.pack(target))
        return arrived
