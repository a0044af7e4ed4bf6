"""A master axis and a slave axis joined by a coupling, whose steps come as an argument.

One `cycle_pair` is: slots that went by, close on both sides, exchange, decide on both sides. The
two sides never see each other's present, so the order in which they are evaluated changes no bit.
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
from tautwave.controller.records import (
    AxisParams,
    AxisState,
    PairParams,
    PairView,
    RunView,
    Sample,
)
from tautwave.controller.steps import Steps


def pair_at(x: RunView, k: int) -> PairView:
    """Return a pair by its number; compiled code has `make_pair` in its place."""
    return x.views[k]


def make_pair(x: RunView, k: int) -> PairView:
    """Return the view of a pair, of what it is made of."""
    q = x.pairs[k]
    one, two = q.master, q.slave
    return PairView(x.states[k], q, x.axes[one], x.axes[two], x.params[one], x.params[two], x.table)


def mismatch(q: PairParams, master_position: float, slave_position: float, offset: float) -> float:
    """Return the slave's distance from its position by `offset` [slave's rad or m]."""
    target = q.ratio * master_position + offset
    return slave_position - target


def start_pair(pair: PairView, master: Sample, slave: Sample, steps: Steps) -> None:
    """Engage at the measured positions."""
    c, q, one, two, p1, p2 = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2
    gap = 0.0
    if q.at_engage:
        c.offset = mismatch(q, master.position, slave.position, 0.0)
    else:
        c.offset = q.offset
        gap = mismatch(q, master.position, slave.position, q.offset)
    start_axis(one, p1, master.position, master.effort)
    start_axis(two, p2, slave.position, slave.effort)
    steps.start(pair, gap)


def engage_pair(pair: PairView, ramp: float, steps: Steps) -> None:
    """Compute the first commands, with nothing on its way; a slow side waits until it is served."""
    one, two, p1, p2, table = pair.one, pair.two, pair.p1, pair.p2, pair.table
    steps.engage(pair)
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
    pair: PairView,
    master: Sample,
    slave: Sample,
    slot: int,
    skipped: int,
    ramp: float,
    steps: Steps,
) -> int:
    """Run one cycle on fresh samples; `skipped` slots went by unseen before this one.

    Before: each side holds the command of the last cycle. In this order, because each step needs
    what the one before leaves:

    1. every slot that passed is filed with the command that acted in it; for a skipped one the
       line moves on as well, since its delay is counted in slots;
    2. a sample closes what was filed: books, and what leaves for the other side;
    3. what left is exchanged; a side sees nothing younger of the other than this;
    4. each side decides its next command.

    A pair with a slow side does the first three slot by slot, for the sides that are due in it.
    Afterwards both commands are set, or a guard says why an axis stops.

    Returns
    -------
    int
        Codes of the guards of both sides, added; each stands in its axis' `guard`.
    """
    q, one, two, p1, p2, table = pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
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
            steps.exchange(pair, seen, due_master, due_slave)
    else:
        pass_slot(one, p1, table, steps)
        pass_slot(two, p2, table, steps)
        for _ in range(skipped):
            steps.exchange(pair, False, True, True)
            pass_slot(one, p1, table, steps)
            pass_slot(two, p2, table, steps)
        take_sample(one, p1, master, steps)
        take_sample(two, p2, slave, steps)
        steps.exchange(pair, True, True, True)
    one.guard = 0
    two.guard = 0
    if due_master:
        one.guard = decide_axis(one, p1, table, master.valid, ramp, steps)
    if due_slave:
        two.guard = decide_axis(two, p2, table, slave.valid, ramp, steps)
    return one.guard + two.guard


def position_error(pair: PairView) -> float:
    """Return master position less the slave's in master units [rad or m]."""
    q = pair.q
    return pair.one.position - q.to_master * (pair.two.position - pair.c.offset)


def effort_error(pair: PairView) -> float:
    """Return the sum of both ports' efforts in master units [N m or N]; 0 in equilibrium."""
    q = pair.q
    return pair.one.port_effort + q.sign * pair.two.port_effort / q.force_scale
