"""One axis shaken by itself, all others without effort: what `identify` puts in the loop.

The axis' own laws, guards and limits stay: the multisine is the far end of a weak position
coupling, so that effort = excitation - K (x - centre) - B v, limited last before the motor. The
coupling between master and slave does not exist. SI units; rotary axes read N m and rad.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.contracts import Row
from tautwave.errors import SafetyStop
from tautwave.laws.limit import guard_axis
from tautwave.laws.site import SiteParams
from tautwave.rig import Assembly, pair_scale, site_params
from tautwave.runtime.books import axis_columns, fill_axis
from tautwave.runtime.loop import LoopPair
from tautwave.runtime.pair import Pair, PairScale
from tautwave.runtime.site import SiteAxis
from tautwave.types import CommandDelay, JointState

LINES = 8
"""Frequencies of the multisine."""

LOWEST_HZ, HIGHEST_HZ = 0.7, 15.0
RETURN_HZ, RETURN_DAMPING = 0.5, 0.5
RISE_S = 1.5
"""Of the excitation to what the rig's belief allows; then e-fold per `GROW_S` while too little."""

GROW_S = 1.5
FALL_S = 0.05
MEMORY_S = 1.0
ENOUGH, SPEED_SHARE = 0.7, 0.5
LEAST_ROOM, ROOM_SHARE = 0.1, 0.6


class Plan(NamedTuple):
    """How an axis is shaken.

    `efforts` per slot before the gain [N m or N]; the greatest effort and the reach from the
    start [rad or m] it keeps to, the speed [rad/s or m/s]; stiffness and damping of the return;
    the ends of the position range.
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
    position range if not given); what it takes to move a heavier one is found in the run.
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

    def start(self, position: float) -> None:
        """Begin, about where the device stands, with the room there is.

        Raises
        ------
        SafetyStop
            It stands too near an end of its range.
        """
        plan = self._plan
        room = min(position - plan.low, plan.high - position)
        if room < LEAST_ROOM * (plan.high - plan.low):
            raise SafetyStop(
                f"{plan.axis} stands at {position:.4g}, at the end of its range"
                f" [{plan.low:g}, {plan.high:g}]; move it towards the middle"
            )
        self.centre = position
        self._reach = min(plan.reach, ROOM_SHARE * room)

    def pass_slots(self, count: int) -> None:
        """Let slots go by."""
        self._slot += count

    def effort(self, position: float, velocity: float) -> float:
        """Return the excitation of this slot [N m or N], having looked at how far it moves.

        Each time the device goes beyond reach or speed, the gain falls to half of what it was.
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


class ExcitedPair(Pair):
    """A pair without coupling: at most one of its axes is shaken, the others get no effort."""

    def __init__(
        self,
        name: str,
        master: SiteAxis,
        slave: SiteAxis,
        scale: PairScale,
        plans: dict[str, Plan],
    ) -> None:
        super().__init__(name, master, slave, scale)
        self._sides = []
        both = (("master", master), ("slave", slave))
        for side, site in both[: 1 if master is slave else 2]:  # a scene's port is one axis
            plan = plans.get(f"{side}.{name}")
            shaken = None if plan is None else Excitation(plan)
            self._sides.append((site, shaken, 1.0 if plan is None else plan.stiffness))

    def start(self, master: JointState, slave: JointState, offset: float | None) -> None:
        """Begin at the measured positions, whatever they are to each other."""
        super().start(master, slave, None)
        for (_, shaken, _), state in zip(self._sides, (master, slave), strict=False):
            if shaken is not None:
                shaken.start(state.position)

    def engage(self, ramp: float) -> None:
        """Nothing is asked for yet."""

    def cycle(self, master: JointState, slave: JointState, skipped: int, ramp: float) -> None:
        """Run one cycle on fresh samples; `skipped` slots went by unseen before this one."""
        codes = []
        for (site, shaken, stiffness), state in zip(self._sides, (master, slave), strict=False):
            for _ in range(1 + skipped):
                site.pass_slot()
            if shaken is not None:
                shaken.pass_slots(1 + skipped)
            code = 0
            if not state.valid:
                site.miss()
                if site.stopping:
                    site.fade(ramp * site.ceiling)
            else:
                site.close(state.position, state.effort)
                if shaken is None:
                    code = guard_axis(site.params.limit, site.position, site.velocity)
                else:
                    effort = shaken.effort(site.position, site.velocity)
                    code = site.think(shaken.centre + effort / stiffness, 0.0, ramp * site.ceiling)
            codes.append(code)
        self.guard = sum(code << 3 * at for at, code in enumerate(codes))


class ExcitedRow:
    """The columns of both axes of a pair; there is no coupling to keep books of."""

    def __init__(self, pair: Pair) -> None:
        self._sites = [pair.master]
        self.columns = list(axis_columns(f"master.{pair.name}", pair.master))
        if pair.slave is not pair.master:
            self._sites.append(pair.slave)
            self.columns += axis_columns(f"slave.{pair.name}", pair.slave)

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`."""
        for site in self._sites:
            at = fill_axis(site, 1.0, row, at)


def excite(rig: Rig, assembly: Assembly, plan: Plan) -> Assembly:
    """Return the assembly with every pair's coupling, or its scene, replaced by `ExcitedPair`."""
    sites = {}
    buses = []
    for bus in assembly.buses:
        delay = bus.driver.command_delay
        for name in bus.axes:
            shaken = name == plan.axis
            params = _params(rig, name, delay)._replace(
                has_wall=False,
                stiffness=plan.stiffness if shaken else 0.0,
                damping=plan.damping if shaken else 0.0,
            )
            sites[name] = SiteAxis(
                params,
                delay_periods=delay.periods,
                coupled_by_wave=False,
                impedance=rig.axes[name].causality == "impedance",
                late_share=delay.remainder_s / rig.period_s,
            )
        buses.append(bus._replace(sites=[sites[name] for name in bus.axes]))
    pairs = []
    for at in assembly.pairs:
        name = at.pair.name
        master = sites[f"master.{name}"]
        slave = sites.get(f"slave.{name}", master)
        scale = PairScale(1.0, 1.0, 1.0, 1.0)
        if rig.scene is None:
            scale = pair_scale(rig.coupling.pairs[name])
        pair = ExcitedPair(name, master, slave, scale, {plan.axis: plan})
        pairs.append(LoopPair(pair, at.master_at, at.slave_at, None, math.inf))
    rows = [ExcitedRow(at.pair) for at in pairs]
    # A pair has a row of its own, a scene one for all its ports.
    replaced = len(assembly.pairs) if rig.scene is None else 1
    sources = [*rows, *assembly.sources[replaced:]]
    before = sum(len(source.columns) for source in assembly.sources)
    timing = assembly.columns[: len(assembly.columns) - before]
    columns = [*timing, *(name for source in sources for name in source.columns)]
    return assembly._replace(buses=buses, pairs=pairs, sources=sources, columns=columns, scene=None)


def _params(rig: Rig, name: str, delay: CommandDelay) -> SiteParams:
    if rig.scene is None:
        return site_params(rig, name, delay)
    from tautwave.rig.scene import scene_site

    return scene_site(rig, name, delay).params
