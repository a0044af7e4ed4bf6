"""A master axis and a slave axis joined by the wave line or by a position coupling.

One `cycle_pair` is: slots that went by, close on both sides, exchange, think on both sides. The two
sides never see each other's present, so the order in which they are evaluated changes no bit.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.axis import (
    decide_axis,
    pass_slot,
    receive_wave,
    start_axis,
    take_sample,
)
from tautwave.controller.line import exchange_states, exchange_waves, filter_waves
from tautwave.controller.rates import is_due, pass_rated
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, Sample
from tautwave.laws.coupler import coupler_loss, coupler_stored


def mismatch(q: PairParams, master_position: float, slave_position: float, offset: float) -> float:
    """Return how far the slave is from where `offset` wants it [slave's rad or m]."""
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
) -> None:
    """Engage at the measured positions."""
    gap = 0.0
    if q.at_engage:
        c.offset = mismatch(q, master.position, slave.position, 0.0)
    else:
        c.offset = q.offset
        gap = mismatch(q, master.position, slave.position, q.offset)
    start_axis(one, p1, master.position, master.effort, 0.0)
    start_axis(two, p2, slave.position, slave.effort, gap * p2.site.port.root)
    if not q.by_wave:
        c.at = 0
        for i in range(q.samples):
            table[q.line + i] = master.position
            table[q.line + q.samples + i] = slave.position
            table[q.line + 2 * q.samples + i] = 0.0
            table[q.line + 3 * q.samples + i] = 0.0
        c.error = 0.0
        book_spring(c, q, one, two, p1)
        c.start_stored = c.stored
        c.dissipated = 0.0


def book_spring(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, p1: AxisParams
) -> None:
    """Book the spring between the present positions, in pair units."""
    stiffness = p1.site.stiffness
    absorbed = one.port_absorbed + q.weight * two.port_absorbed
    far = q.to_master * (two.position - c.offset)
    error = one.position - far
    c.stored = coupler_stored(stiffness, one.position, far)
    c.dissipated += coupler_loss(stiffness, absorbed - c.absorbed, c.error, error)
    c.absorbed = absorbed
    c.error = error


def skip_slot(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> None:
    """Pass a slot that the loop did not see: nothing enters the line, what leaves it arrives."""
    if q.by_wave:
        at_master = 0.0
        at_slave = 0.0
        if q.samples > 0:
            at_master, at_slave = exchange_waves(c, q, table, 0.0, 0.0)
        receive_wave(one, p1, at_master)
        receive_wave(two, p2, at_slave)
    else:
        exchange_states(c, q, one, two, table)


def exchange(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> None:
    """Exchange what both sides closed."""
    if q.by_wave:
        from_master = one.leaving
        from_slave = two.leaving
        if q.filtered:
            from_master, from_slave = filter_waves(c, q, from_master, from_slave)
        at_master = from_slave
        at_slave = from_master
        if q.samples > 0:
            at_master, at_slave = exchange_waves(c, q, table, from_master, from_slave)
        receive_wave(one, p1, at_master)
        receive_wave(two, p2, at_slave)
    else:
        book_spring(c, q, one, two, p1)
        see_far_sides(c, q, one, two, table)


def see_far_sides(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, table: MutableSequence[float]
) -> None:
    """Exchange positions and velocities, each given in the units of the side that sees it."""
    back, back_velocity, ahead, ahead_velocity = exchange_states(c, q, one, two, table)
    one.far_position = q.to_master * (back - c.offset)
    one.far_velocity = q.to_master * back_velocity
    two.far_position = q.ratio * ahead + c.offset
    two.far_velocity = q.ratio * ahead_velocity


def engage_pair(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
    ramp: float,
) -> None:
    """Think for the first time, with nothing on its way; a slow side thinks when served next."""
    if q.by_wave:
        receive_wave(one, p1, 0.0)
        receive_wave(two, p2, 0.0)
    else:
        see_far_sides(c, q, one, two, table)
    if p1.divisor == 1:
        decide_axis(one, p1, table, True, ramp)
    if p2.divisor == 1:
        decide_axis(two, p2, table, True, ramp)


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
            pass_rated(c, q, one, two, p1, p2, master, slave, table, at, seen)
        due_master = is_due(p1, slot)
        due_slave = is_due(p2, slot)
    else:
        pass_slot(one, p1, table)
        pass_slot(two, p2, table)
        for _ in range(skipped):
            skip_slot(c, q, one, two, p1, p2, table)
            pass_slot(one, p1, table)
            pass_slot(two, p2, table)
        take_sample(one, p1, master)
        take_sample(two, p2, slave)
        exchange(c, q, one, two, p1, p2, table)
    one.guard = 0
    two.guard = 0
    if due_master:
        one.guard = decide_axis(one, p1, table, master.valid, ramp)
    if due_slave:
        two.guard = decide_axis(two, p2, table, slave.valid, ramp)
    return one.guard + two.guard


def position_error(c: PairState, q: PairParams, one: AxisState, two: AxisState) -> float:
    """Return master position less the slave's in master units [rad or m]."""
    return one.position - q.to_master * (two.position - c.offset)


def effort_error(q: PairParams, one: AxisState, two: AxisState) -> float:
    """Return the sum of both ports' efforts in master units [N m or N]; 0 in equilibrium."""
    return one.port_effort + q.sign * two.port_effort / q.force_scale
