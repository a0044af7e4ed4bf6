"""How an axis of the controller stops: the certified damping in place of coupling and wall."""

from __future__ import annotations

from tautwave.controller.records import AxisParams, AxisState
from tautwave.controller.steps import Steps
from tautwave.laws.limit import STOPPED, UNSEEN, limit_effort, stop_effort


def stop_axis(s: AxisState, p: AxisParams, ceiling: float) -> None:
    """Replace coupling and wall by the certified damping of a passive stop."""
    brake_axis(s, p, stop_effort(p.site.limit, s.velocity), ceiling)


def stop_coupled(s: AxisState, p: AxisParams, ceiling: float, steps: Steps) -> None:
    """Stop an axis by as much of its damping as the coupling can answer for."""
    brake_axis(s, p, steps.brake(s, p, stop_effort(p.site.limit, s.velocity)), ceiling)


def brake_axis(s: AxisState, p: AxisParams, effort: float, ceiling: float) -> None:
    """Send a resisting effort in place of coupling and wall; an admittance axis stands.

    A device in fault gets nothing.
    """
    s.stopping = True
    s.limited = STOPPED
    total = 0.0
    s.command = 0.0
    if p.impedance and not s.dead:
        total = ramp_effort(s, p, effort, ceiling)
        s.command = -total
    s.total = total
    s.port_effort = total
    s.wall_effort = 0.0
    s.inertia.effort = 0.0


def ramp_effort(s: AxisState, p: AxisParams, effort: float, ceiling: float) -> float:
    """Return how far the last effort may go towards another one [N m or N].

    The rate limit counts every slot since the last command: a host that stalls during the ramp
    holds an effort longer, but the ramp ends when it would have ended.
    """
    slots = s.count
    if s.valid:
        slots = s.waited
    last = s.total
    total = limit_effort(p.site.limit, effort, last, ceiling)
    slots = slots - s.ramped - 1
    while slots > 0 and total != last:
        last = total
        total = limit_effort(p.site.limit, effort, last, ceiling)
        slots = slots - 1
    s.ramped = 0
    if not s.valid:
        s.ramped = s.count
    return total


def miss_axis(s: AxisState, p: AxisParams, ceiling: float) -> int:
    """Keep the command in a cycle without a sample, and let it go in a stop; return the guard.

    Slots that a stalled host skipped count as well: beyond `p.blind` periods without a sample the
    axis stops. Nobody sees it then: its effort goes to 0 by the rate limit, its velocity at once.
    """
    guard = 0
    if s.count >= p.blind:
        s.stopping = True
        guard = UNSEEN
    if s.stopping:
        brake_axis(s, p, 0.0, ceiling)
    return guard
