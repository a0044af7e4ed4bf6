"""How an axis that no coupling holds is pulled into place."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.controller.records import AxisState
from tautwave.laws.rest.alignment import (
    AlignParams,
    align_effort,
    gate_effort,
    grow_push,
    is_spent,
    lead_reference,
    move_reference,
)


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


def is_still(s: AxisState, since: float, span: float, quantum: float, slowest: float) -> bool:
    """Return whether an axis moved less than `slowest` [rad/s or m/s] for `span` s."""
    return abs(s.position - since) <= slowest * span + 2.0 * quantum
