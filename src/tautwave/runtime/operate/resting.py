"""An axis while no coupling holds it: free, held by certified damping, or pulled into place."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.controller.axis import pass_slot, start_axis, take_sample
from tautwave.controller.records import AxisParams, AxisState, Sample
from tautwave.controller.steps import ALONE
from tautwave.laws.alignment import (
    AlignParams,
    align_effort,
    gate_effort,
    grow_push,
    is_spent,
    lead_reference,
    move_reference,
)
from tautwave.laws.limit import limit_effort, stop_effort


class PullParams(NamedTuple):
    """Alignment of one axis: its law, and the friction and inertia that its budget is made of.

    `reach` [rad or m] is how near to its target the device has to come; a target below `low` or
    above `high` [rad or m], the ends of its range, is not gone to.
    """

    law: AlignParams
    coulomb: float
    viscous: float
    inertia: float
    reach: float
    low: float
    high: float

    def refusal(self, target: float) -> str:
        """Say why the device is not brought to a target [rad or m], empty if it may be."""
        if self.low <= target <= self.high:
            return ""
        return f"its target, {target:.4g}, is outside its position_range"


class Pull:
    """A running alignment of one axis."""

    def __init__(self, params: PullParams, position: float, target: float, budget: float) -> None:
        self.params = params
        self.target = target
        self.budget = budget
        self.reference = position
        self.rate = self.push = 0.0

    def effort(self, s: AxisState) -> float:
        """Return the resisting effort of this period [N m or N]; `s` counts what went in."""
        law = self.params.law
        moved = move_reference(law, self.reference, self.rate, self.target)
        self.reference, self.rate = lead_reference(law, *moved, s.position)
        self.push = grow_push(law, self.push, self.reference, s.position)
        wanted = align_effort(law, self.reference, self.rate, s.position, s.velocity, self.push)
        return -gate_effort(law, wanted, s.velocity, -s.port_energy, self.budget)

    def spent(self, s: AxisState) -> bool:
        """Return whether the budget is at its end."""
        return is_spent(self.params.law, -s.port_energy, self.budget)

    def hindrance(self, s: AxisState) -> str:
        """Say what may keep the device from its target."""
        if self.spent(s):
            return "its energy budget is used up"
        return "it is blocked, or its friction exceeds the rig's `coulomb`"

    def there(self, s: AxisState) -> bool:
        """Return whether the device is at its target."""
        return self.reference == self.target and abs(s.position - self.target) <= self.params.reach


def sense_resting(
    s: AxisState, p: AxisParams, m: Sample, table: list[float], skipped: int, seated: bool
) -> bool:
    """Pass the slots and close them without a coupling; return whether the axis is seated.

    The first sample seats it: before that its position is not known.
    """
    if not seated:
        if m.valid:
            start_axis(s, p, m.position, m.effort)
        return m.valid
    for _ in range(skipped + 1):
        pass_slot(s, p, table, ALONE.steps)
    take_sample(s, p, m, ALONE.steps)
    return True


def send_resting(s: AxisState, p: AxisParams, effort: float, ceiling: float) -> None:
    """Send a resisting effort within limits; an axis that takes velocity stands."""
    total = 0.0
    s.command = 0.0
    if p.impedance:
        total = limit_effort(p.site.limit, effort, s.total, ceiling)
        s.command = -total
    s.asked = effort
    s.total = total
    s.port_effort = total
    s.wall_effort = 0.0
    s.tag = 0.0
    s.stopping = False


class Holds:
    """Certified damping of axes at rest, each with a capital of energy.

    Parameters
    ----------
    params : sequence of AxisParams
        Constants of the axes.
    quanta : sequence of float
        Their encoder steps [rad or m].
    """

    def __init__(self, params: Sequence[AxisParams], quanta: Sequence[float]) -> None:
        self.capital = [hold_capital(p, q) for p, q in zip(params, quanta, strict=True)]
        """[J] What a hold may supply, by axis."""
        # The last command of before acts for as many closings after the first; a late share of it
        # acts in one more.
        self._acts = [p.delay + (p.late > 0.0) for p in params]
        self.begin()

    def begin(self) -> None:
        """Count what the axes supply, from 0."""
        self._until = [-1] * len(self._acts)
        self._closed = [-1] * len(self._acts)
        self._floor = [0.0] * len(self._acts)

    def effort(self, which: int, slot: int, s: AxisState, p: AxisParams) -> float:
        """Return the damping effort of an axis [N m or N], none once its capital is gone.

        What commands of before the hold still give out was granted to them: the capital counts
        from there, else a hold that follows a push would not damp.
        """
        if self._until[which] < 0:
            self._until[which] = slot + self._acts[which]
        if self._closed[which] < self._until[which]:
            self._floor[which] = min(self._floor[which], s.port_energy)
        self._closed[which] = slot
        if s.port_energy <= self._floor[which] - self.capital[which]:
            return 0.0
        return stop_effort(p.site.limit, s.velocity)


def hold_capital(p: AxisParams, quantum: float) -> float:
    """Return what a hold may supply [J]: ten encoder steps against its own damping."""
    per_step = p.site.limit.stop_damping * p.site.gain / p.site.period
    return 10.0 * per_step * quantum * quantum


def is_still(s: AxisState, since: float, span: float, quantum: float, slowest: float) -> bool:
    """Return whether an axis moved less than `slowest` [rad/s or m/s] for `span` s."""
    return abs(s.position - since) <= slowest * span + 2.0 * quantum
