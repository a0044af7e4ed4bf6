"""An axis that no coupling holds: what is sensed of it, and what it is sent."""

from __future__ import annotations

from tautwave.controller.axis import pass_slot, start_axis, take_sample
from tautwave.controller.braking import ramp_effort
from tautwave.controller.records import AxisParams, AxisState, Sample
from tautwave.controller.steps import ALONE
from tautwave.laws.limit import limit_effort


def resting(p: AxisParams) -> AxisParams:
    """Return the constants of an axis that no coupling holds: no wall, no compensation either."""
    alone = p.site._replace(has_wall=False, compensates=False, compensates_inertia=False)
    return p._replace(site=alone)


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


def send_resting(
    s: AxisState, p: AxisParams, effort: float, ceiling: float, *, pushes: bool = False
) -> None:
    """Send a resisting effort within limits; an axis that takes velocity, or is dead, gets 0.

    The rate limit counts the slots that a stalled host skipped, as in a stop, unless it `pushes`.
    """
    total = 0.0
    s.command = 0.0
    if p.impedance and not s.dead:
        if pushes and effort != 0.0:
            total = limit_effort(p.site.limit, effort, s.total, ceiling)
            s.ramped = 0 if s.valid else s.count
        else:
            total = ramp_effort(s, p, effort, ceiling)
        s.command = -total
    s.asked = effort
    s.limited = 0
    s.total = total
    s.port_effort = total
    s.wall_effort = 0.0
    s.tag = 0.0
    s.stopping = False
