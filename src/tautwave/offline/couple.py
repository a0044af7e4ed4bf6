"""A pair: `runtime.pair` and `link.memory` as functions over records.

The line's four rings of a pair lie one after the other: from master, from slave, and with the
position law the velocities of both.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.laws.coupler import coupler_loss, coupler_stored
from tautwave.laws.wall import wall_effort
from tautwave.laws.wave import filter_step
from tautwave.offline.records import Body, Couple, PairParams, Side, SideParams
from tautwave.offline.side import receive_side, start_side


def mismatch(q: PairParams, master_position: float, slave_position: float, offset: float) -> float:
    """Return how far the slave is from where `offset` wants it [slave's rad or m]."""
    target = q.ratio * master_position + offset
    return slave_position - target


def start_pair(
    c: Couple,
    q: PairParams,
    one: Side,
    two: Side,
    p1: SideParams,
    p2: SideParams,
    master: Body,
    slave: Body,
    table: MutableSequence[float],
) -> None:
    """Engage at the measured positions."""
    gap = 0.0
    if q.at_engage:
        c.offset = mismatch(q, master.position, slave.position, 0.0)
    else:
        c.offset = q.offset
        gap = mismatch(q, master.position, slave.position, q.offset)
    start_side(one, p1, master.position, master.effort, 0.0)
    start_side(two, p2, slave.position, slave.effort, gap * p2.site.port.root)
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


def arm_side(s: Side, p: SideParams, share: float) -> bool:
    """Return True when the wall asks for less than `share` of the limit where the axis stands."""
    if p.site.has_wall:
        effort = wall_effort(p.site.wall, s.depth, 0.0)
        limit = share * p.site.limit.effort
        if effort * effort > limit * limit:
            return False
    return True


def exchange_waves(
    c: Couple,
    q: PairParams,
    table: MutableSequence[float],
    from_master: float,
    from_slave: float,
) -> tuple[float, float]:
    """Pass one slot on the wave line; return the waves arriving at (master, slave)."""
    ahead = q.line + c.at
    back = ahead + q.samples
    at_slave = table[ahead]
    at_master = table[back]
    table[ahead] = from_master
    table[back] = from_slave
    c.at += 1
    if c.at == q.samples:
        c.at = 0
    c.line_energy += q.half_period * (
        from_master * from_master
        + from_slave * from_slave
        - at_slave * at_slave
        - at_master * at_master
    )
    return at_master, at_slave


def exchange_states(
    c: Couple, q: PairParams, one: Side, two: Side, table: MutableSequence[float]
) -> tuple[float, float, float, float]:
    """Pass one slot; return far position and velocity at the master, then at the slave."""
    if q.samples == 0:
        return two.position, two.velocity, one.position, one.velocity
    at = q.line + c.at
    ahead = table[at]
    table[at] = one.position
    at = at + q.samples
    back = table[at]
    table[at] = two.position
    at = at + q.samples
    ahead_rate = table[at]
    table[at] = one.velocity
    at = at + q.samples
    back_rate = table[at]
    table[at] = two.velocity
    c.at += 1
    if c.at == q.samples:
        c.at = 0
    return back, back_rate, ahead, ahead_rate


def book_spring(c: Couple, q: PairParams, one: Side, two: Side, p1: SideParams) -> None:
    """Book the spring between the present positions, in pair units."""
    stiffness = p1.site.stiffness
    absorbed = one.port_absorbed + q.weight * two.port_absorbed
    far = q.to_master * (two.position - c.offset)
    error = one.position - far
    c.stored = coupler_stored(stiffness, one.position, far)
    c.dissipated += coupler_loss(stiffness, absorbed - c.absorbed, c.error, error)
    c.absorbed = absorbed
    c.error = error


def filter_waves(
    c: Couple, q: PairParams, from_master: float, from_slave: float
) -> tuple[float, float]:
    """Low-pass both leaving waves and book them."""
    return filter_from_master(c, q, from_master), filter_from_slave(c, q, from_slave)


def filter_from_master(c: Couple, q: PairParams, wave: float) -> float:
    """Low-pass the wave that leaves the master and book it."""
    u, stored, lost = filter_step(q.filter_gain, q.period, c.filter_master, wave)
    c.filter_master = u
    c.filter_master_stored = stored
    c.filter_master_dissipated += lost
    c.filter_master_absorbed += q.half_period * (wave * wave - u * u)
    return u


def filter_from_slave(c: Couple, q: PairParams, wave: float) -> float:
    """Low-pass the wave that leaves the slave and book it."""
    u, stored, lost = filter_step(q.filter_gain, q.period, c.filter_slave, wave)
    c.filter_slave = u
    c.filter_slave_stored = stored
    c.filter_slave_dissipated += lost
    c.filter_slave_absorbed += q.half_period * (wave * wave - u * u)
    return u


def skip_slot(
    c: Couple,
    q: PairParams,
    one: Side,
    two: Side,
    p1: SideParams,
    p2: SideParams,
    table: MutableSequence[float],
) -> None:
    """Pass a slot that the loop did not see: nothing enters the line, what leaves it arrives."""
    if q.by_wave:
        at_master = 0.0
        at_slave = 0.0
        if q.samples > 0:
            at_master, at_slave = exchange_waves(c, q, table, 0.0, 0.0)
        receive_side(one, p1, at_master)
        receive_side(two, p2, at_slave)
    else:
        exchange_states(c, q, one, two, table)


def meet(
    c: Couple,
    q: PairParams,
    one: Side,
    two: Side,
    p1: SideParams,
    p2: SideParams,
    table: MutableSequence[float],
    fresh: bool,
) -> None:
    """Exchange what both sides closed; `fresh` is the first time, with nothing on its way yet."""
    if q.by_wave:
        at_master = 0.0
        at_slave = 0.0
        if not fresh:
            from_master = one.leaving
            from_slave = two.leaving
            if q.filtered:
                from_master, from_slave = filter_waves(c, q, from_master, from_slave)
            at_master = from_slave
            at_slave = from_master
            if q.samples > 0:
                at_master, at_slave = exchange_waves(c, q, table, from_master, from_slave)
        receive_side(one, p1, at_master)
        receive_side(two, p2, at_slave)
    else:
        if not fresh:
            book_spring(c, q, one, two, p1)
        back, back_rate, ahead, ahead_rate = exchange_states(c, q, one, two, table)
        one.far = q.to_master * (back - c.offset)
        one.far_rate = q.to_master * back_rate
        two.far = q.ratio * ahead + c.offset
        two.far_rate = q.ratio * ahead_rate
