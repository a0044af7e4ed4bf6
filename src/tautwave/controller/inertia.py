"""Compensation of a device's inertia, beside the coupling: observer, effort, account."""

from __future__ import annotations

import math

from tautwave.controller.records import AxisParams, AxisState
from tautwave.laws.account import close_account
from tautwave.laws.compensation import follow_play, inertia_effort
from tautwave.laws.observer import observe


def start_inertia(s: AxisState, p: AxisParams) -> None:
    """Begin at rest, with the reserve."""
    e = s.inertia
    e.at = s.position
    e.velocity = 0.0
    e.push = 0.0
    e.play = s.position
    e.funds = p.site.inertia.account.reserve
    e.effort = 0.0
    e.acted = 0.0
    e.sum = 0.0
    e.work = 0.0
    e.paid = 0.0
    e.charged = 0.0
    e.spilled = 0.0


def close_inertia(s: AxisState, p: AxisParams, displacement: float, count: float) -> float:
    """Observe what accelerates the device, book what acted, and return that [N m or N]."""
    e = s.inertia
    k = p.site.inertia
    effort: float = e.sum
    e.sum = 0.0
    if count != 1.0:
        effort = effort / count
    at, velocity, push = observe(k.observer, e.at, e.velocity, e.push, s.position, effort, count)
    e.at = at
    e.velocity = velocity
    e.push = push
    play = follow_play(e.play, s.position, k.play)
    paid = k.coulomb * math.fabs(play - e.play)
    charge = count * k.account.income
    work = effort * displacement
    funds, spilled = close_account(k.account, e.funds, work + paid + charge)
    e.play = play
    e.funds = funds
    e.work += work
    e.paid += paid
    e.charged -= charge
    e.spilled += spilled
    return effort


def lighten(s: AxisState, p: AxisParams, free_velocity: float, ceiling: float) -> float:
    """Return the effort of the next period [N m or N]; `free_velocity` is its velocity without it.

    Its share of the axis falls with the `ceiling` as that of coupling and wall does: beside a
    spring whose ends are clipped alike, more of it would be taken from one end alone.
    """
    e = s.inertia
    site = p.site
    most = site.inertia.most
    if ceiling < site.limit.effort:
        most = most * (ceiling / site.limit.effort)
    e.effort = inertia_effort(
        site.inertia, e.funds, e.push, free_velocity, site.half_mobility, site.period, most
    )
    effort: float = e.effort
    return effort
