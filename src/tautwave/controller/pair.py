"""A master axis and a slave axis joined by a coupling, whose steps come as an argument.

One `cycle_pair` is: slots that went by, close on both sides, exchange, think on both sides. The two
sides never see each other's present, so the order in which they are evaluated changes no bit.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.axis import (
    decide_axis,
    is_due,
    miss_sample,
    pass_slot,
    start_axis,
    take_sample,
)
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, Sample
from tautwave.controller.steps import Steps


def mismatch(q: PairParams, master_position: float, slave_position: float, offset: float) -> float:
    """Return the slave's distance from its position by `offset` [slave's rad or m]."""
    target = q.ratio * master_position + offset
    return slave_position - target


def start_pair(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    master: Sample,
    slave: Sample,
    table: MutableSequence[float],
    steps: Steps,
) -> None:
    """Engage at the measured positions."""
    gap = 0.0
    if q.at_engage:
        c.offset = mismatch(q, master.position, slave.position, 0.0)
    else:
        c.offset = q.offset
        gap = mismatch(q, master.position, slave.position, q.offset)
    start_axis(one, p1, master.position, master.effort)
    start_axis(two, p2, slave.position, slave.effort)
    steps.start(c, q, one, two, p1, p2, gap, table)


def engage_pair(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
    ramp: float,
    steps: Steps,
) -> None:
    """Think for the first time, with nothing on its way; a slow side thinks when served next."""
    steps.engage(c, q, one, two, p1, p2, table)
    if p1.divisor == 1:
        decide_axis(one, p1, table, True, ramp, steps)
    if p2.divisor == 1:
        decide_axis(two, p2, table, True, ramp, steps)


def pass_side(
    s: AxisState,
    p: AxisParams,
    m: Sample,
    table: MutableSequence[float],
    due: bool,
    here: bool,
    steps: Steps,
) -> None:
    """Pass one slot of a pair with a slow side, up to what leaves; `here`: the loop saw it."""
    if due:
        pass_slot(s, p, table, steps)
        if here:
            take_sample(s, p, m, steps)
        elif p.divisor > 1:
            miss_sample(s, p, steps)


def cycle_pair(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    master: Sample,
    slave: Sample,
    table: MutableSequence[float],
    slot: int,
    skipped: int,
    ramp: float,
    steps: Steps,
) -> int:
    """Run one cycle on fresh samples; `skipped` slots went by unseen before this one.

    Returns
    -------
    int
        Codes of the guards of both sides, added; each stands in its axis' `guard`.
    """
    due_master = True
    due_slave = True
    if q.rated:
        for passed in range(skipped + 1):
            at = slot - skipped + passed
            seen = passed == skipped
            due_master = is_due(p1, at)
            due_slave = is_due(p2, at)
            pass_side(one, p1, master, table, due_master, seen, steps)
            pass_side(two, p2, slave, table, due_slave, seen, steps)
            steps.exchange(c, q, one, two, p1, p2, table, seen, due_master, due_slave)
    else:
        pass_slot(one, p1, table, steps)
        pass_slot(two, p2, table, steps)
        for _ in range(skipped):
            steps.exchange(c, q, one, two, p1, p2, table, False, True, True)
            pass_slot(one, p1, table, steps)
            pass_slot(two, p2, table, steps)
        take_sample(one, p1, master, steps)
        take_sample(two, p2, slave, steps)
        steps.exchange(c, q, one, two, p1, p2, table, True, True, True)
    one.guard = 0
    two.guard = 0
    if due_master:
        one.guard = decide_axis(one, p1, table, master.valid, ramp, steps)
    if due_slave:
        two.guard = decide_axis(two, p2, table, slave.valid, ramp, steps)
    return one.guard + two.guard


def position_error(c: PairState, q: PairParams, one: AxisState, two: AxisState) -> float:
    """Return master position less the slave's in master units [rad or m]."""
    return one.position - q.to_master * (two.position - c.offset)


def effort_error(q: PairParams, one: AxisState, two: AxisState) -> float:
    """Return the sum of both ports' efforts in master units [N m or N]; 0 in equilibrium."""
    return one.port_effort + q.sign * two.port_effort / q.force_scale
