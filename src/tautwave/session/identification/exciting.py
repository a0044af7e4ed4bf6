"""Excitation of axes, all others without effort: the controller of `identify`.

An axis' own laws, guards and limits stay: the multisine is the far end of a weak position
coupling, so that effort = excitation - K (x - centre) - B v, limited last before the motor. There
is no coupling between master and slave. SI units; rotary axes read N m and rad.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from tautwave.config import Rig
from tautwave.contracts import Row
from tautwave.controller.axis import decide_axis, pass_slot, start_axis, take_sample
from tautwave.controller.braking import miss_axis
from tautwave.controller.records import FINISHED, PIPE, AxisParams, AxisState, RunParams
from tautwave.controller.rows import axis_columns, fill_axis
from tautwave.controller.run import arm, ramp_share, stop_on_guard
from tautwave.controller.steps import Law, Steps
from tautwave.controller.stops import AxisName
from tautwave.errors import SafetyStop
from tautwave.laws.coupler import coupler_effort
from tautwave.laws.limit import guard_axis
from tautwave.rig import Assembly, axis_names, bare_site, controlled_axis, site_params
from tautwave.rig.hooks import rig_hooks
from tautwave.runtime.control import Control

LINES = 8
"""Frequencies of the multisine."""

LOWEST_HZ, HIGHEST_HZ = 0.7, 15.0
RETURN_HZ, RETURN_DAMPING = 0.5, 0.5
RISE_S = 1.5
"""Initial gain relative to the rig's belief; then it grows e-fold per `GROW_S` while too small."""

GROW_S = 1.5
FALL_S = 0.05
MEMORY_S = 1.0
ENOUGH, SPEED_SHARE = 0.7, 0.5
MIN_ROOM, ROOM_SHARE = 0.1, 0.6


class ShakenParams(NamedTuple):
    """Spring [N m/rad or N/m] and damper [N m s/rad or N s/m] to the excitation."""

    stiffness: float
    damping: float


@dataclass(slots=True)
class ShakenEnd:
    """Where the excitation has the far end of the spring [rad or m]."""

    far_position: float = 0.0


def pull_back(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort of the spring and of the damper to ground [N m or N]."""
    k = p.end
    far = s.end.far_position
    return coupler_effort(k.stiffness, k.damping, s.position, s.velocity, far, 0.0)


SHAKEN = Law("excitation", Steps(compute_effort=pull_back), ShakenEnd)


class Mover(Protocol):
    """Moves one axis: the far end of its spring."""

    spring: ShakenParams

    def start(self, position: float) -> None:
        """Begin at the device's position [rad or m]."""
        ...

    def pass_slots(self, count: int) -> None:
        """Skip slots."""
        ...

    def far(self, position: float, velocity: float) -> float:
        """Return where the far end is in this slot [rad or m]."""
        ...


class Plan(NamedTuple):
    """Excitation of an axis.

    `efforts` per slot before the gain [N m or N]; limits of effort, reach from the start [rad or m]
    and speed [rad/s or m/s]; stiffness and damping of the centring spring; the ends of the position
    range.
    """

    axis: str
    efforts: Sequence[float]
    effort: float
    reach: float
    speed: float
    stiffness: float
    damping: float
    highest_hz: float
    period: float
    low: float
    high: float


def plan_excitation(
    rig: Rig, axis_name: str, cycles: int, *, share: float, reach: float | None
) -> Plan:
    """Return the excitation of one axis.

    Eight sines with Schroeder's phases, 0.7 to 15 Hz (at most rate / 50), effort growing as the
    root of the frequency. `effort` is `share` of the axis' limit; the efforts are scaled so that
    the lightest device the rig believes in stays within 0.6 of the `reach` (a quarter of the
    position range if not given); the gain for a heavier one is found during the run.
    """
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    assert axis.position_range is not None
    low, high = axis.position_range
    reach = 0.25 * (high - low) if reach is None else reach
    highest = min(HIGHEST_HZ, rig.rate_hz / 50.0)
    pulse = 2.0 * math.pi * RETURN_HZ
    stiffness = axis.inertia.value * pulse * pulse
    damping = 2.0 * RETURN_DAMPING * axis.inertia.value * pulse
    hz = np.geomspace(min(LOWEST_HZ, 0.2 * highest), highest, LINES)
    size = np.sqrt(hz / highest)
    count = np.arange(LINES)
    phases = -math.pi * count * (count + 1) / LINES
    omega = 2.0 * math.pi * hz
    swing = size / np.abs(stiffness - axis.inertia.lower * omega**2 + 1j * damping * omega)
    travel = 1.6 * float(np.sqrt(np.sum(swing**2)))
    rate = 1.6 * float(np.sqrt(np.sum((omega * swing) ** 2)))
    speed = math.inf if axis.velocity_limit is None else SPEED_SHARE * axis.velocity_limit
    effort = share * axis.effort_limit
    factor = min(0.6 * reach / travel, 0.6 * speed / rate, effort / float(np.sum(size)))
    times = np.arange(cycles + 1) * rig.period_s
    efforts = factor * np.sum(
        size[:, None] * np.sin(omega[:, None] * times + phases[:, None]), axis=0
    )
    return Plan(
        axis_name,
        efforts.tolist(),
        effort,
        reach,
        speed,
        stiffness,
        damping,
        highest,
        rig.period_s,
        low,
        high,
    )


class Excitation:
    """The multisine with a gain that grows until the device moves enough, and halves beyond."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._slot = 0
        self._last_growth = 0.4 * len(plan.efforts)
        self._recent = 0.0
        self._floor = 0.0
        self._far = False
        self._reach = plan.reach
        self.gain = 0.0
        self.centre = 0.0
        self.spring = ShakenParams(plan.stiffness, plan.damping)

    def far(self, position: float, velocity: float) -> float:
        """Return where the far end of the spring is for this slot's effort [rad or m]."""
        return self.centre + self.effort(position, velocity) / self._plan.stiffness

    def start(self, position: float) -> None:
        """Begin around the device's position, within the available room.

        Raises
        ------
        SafetyStop
            It is too close to an end of its range.
        """
        plan = self._plan
        room = min(position - plan.low, plan.high - position)
        if room < MIN_ROOM * (plan.high - plan.low):
            raise SafetyStop(
                f"{plan.axis} is at {position:.4g}, at the end of its range [{plan.low:g}, "
                f"{plan.high:g}]; move it towards the middle"
            )
        self.centre = position
        self._reach = min(plan.reach, ROOM_SHARE * room)

    def pass_slots(self, count: int) -> None:
        """Skip slots."""
        self._slot += count

    def effort(self, position: float, velocity: float) -> float:
        """Return the excitation of this slot [N m or N], with the gain adapted to the motion.

        Each time the device exceeds reach or speed, the gain is halved.
        """
        plan = self._plan
        use = max(abs(position - self.centre) / self._reach, abs(velocity) / plan.speed)
        self._recent = max(use, self._recent * math.exp(-plan.period / MEMORY_S))
        if use > 1.0 and not self._far:
            self._far = True
            self._floor = 0.5 * self.gain
        elif use < ENOUGH:
            self._far = False
        if self._far:
            self.gain = max(self._floor, self.gain * math.exp(-plan.period / FALL_S))
        elif self._recent < ENOUGH and self._slot < self._last_growth:
            planned = self._reach / plan.reach
            if self.gain < planned:
                self.gain = min(self.gain + planned * plan.period / RISE_S, planned)
            else:
                self.gain *= math.exp(plan.period / GROW_S)
        slot = min(self._slot, len(plan.efforts) - 1)
        wanted = self.gain * plan.efforts[slot]
        return min(max(wanted, -plan.effort), plan.effort)


class ExcitedControl(Control):
    """No coupling and no scene: some axes are excited, the others get no effort.

    Parameters
    ----------
    run, names, params
        See `Control`.
    axes : sequence of int
        Axes of the pairs in their order, master and slave; the only axis of a scene's port.
    movers : mapping
        What moves axes, by their full name.
    table : list of float
        Commands on their way.
    """

    def __init__(
        self,
        run: RunParams,
        names: Sequence[AxisName],
        params: Sequence[AxisParams],
        axes: Sequence[int],
        movers: Mapping[str, Mover],
        table: list[float],
    ) -> None:
        super().__init__(run, names, params, SHAKEN)
        self._order = axes
        self._table = table
        self._shaken = {at: movers[names[at].name] for at in axes if names[at].name in movers}
        for at in axes:
            self.columns += axis_columns(names[at].name, params[at], SHAKEN)

    def step(self, slot: int, skipped: int) -> bool:
        """Close every axis and decide the excited one; or begin."""
        r, o = self.run, self.state
        if o.armed_at < 0:
            return self._engage(slot)
        ramp = ramp_share(r, o, slot)
        for at in self._order:
            s, p, m = self.axes[at], self.params[at], self.samples[at]
            for _ in range(1 + skipped):
                pass_slot(s, p, self._table, SHAKEN.steps)
            take_sample(s, p, m, SHAKEN.steps)
            s.guard = 0
            shaken = self._shaken.get(at)
            if shaken is not None:
                shaken.pass_slots(1 + skipped)
                if m.valid:
                    s.end.far_position = shaken.far(s.position, s.velocity)
                s.guard = decide_axis(s, p, self._table, m.valid, ramp, SHAKEN.steps)
            elif m.valid:
                s.guard = guard_axis(p.site.limit, s.position, s.velocity)
            else:
                s.guard = miss_axis(s, p, ramp * p.ceiling)
        for at in self._order:
            stop_on_guard(r, o, self.axes, slot, at)
        return True

    def _engage(self, slot: int) -> bool:
        """Begin at the measured positions, whatever their mismatch."""
        o = self.state
        if o.kind != FINISHED:
            return True
        armed = True
        for at in self._order:
            m = self.samples[at]
            if not m.valid:
                armed = False
                continue
            start_axis(self.axes[at], self.params[at], m.position, m.effort)
            if at in self._shaken:
                self._shaken[at].start(m.position)
        return arm(self.run, o, slot, armed)

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`; there are no books without a coupling."""
        for which in self._order:
            at = fill_axis(row, at, self.axes[which], self.params[which], 1.0, SHAKEN.steps)


def excite(rig: Rig, assembly: Assembly, movers: Mapping[str, Mover]) -> Assembly:
    """Return the assembly with an `ExcitedControl` in place of every coupling, or of its scene."""
    delays = {name: bus.driver.command_delay for bus in assembly.buses for name in bus.axes}
    axes = tuple(delays)
    params = []
    at = 0
    for name in axes:
        make = bare_site if rig.scene is not None else site_params
        site = make(rig, name, delays[name])
        spring = movers[name].spring if name in movers else ShakenParams(0.0, 0.0)
        # No spring's ends are to be clipped alike: each motor may use all that it has.
        site = site._replace(has_wall=False, clip=math.inf)
        blind = rig.loop.missing_limit
        params.append(controlled_axis(rig, name, delays[name], site, at, end=spring, blind=blind))
        at += PIPE * delays[name].periods
    if rig.scene is None:
        ordered = [f"{side}.{name}" for name in rig.coupling.pairs for side in ("master", "slave")]
        order = [axes.index(name) for name in ordered]
    else:
        order = list(rig_hooks().order(assembly.control))
    names = axis_names(rig, axes)
    control = ExcitedControl(assembly.control.run, names, params, order, movers, [0.0] * at)
    before = sum(len(source.columns) for source in assembly.sources)
    timing = assembly.columns[: len(assembly.columns) - before]
    sources = [control, *assembly.sources[1:]]  # the first is the controller's
    columns = [*timing, *(name for source in sources for name in source.columns)]
    return assembly._replace(control=control, sources=sources, columns=columns)
