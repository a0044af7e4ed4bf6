"""A pair with a slow side: `runtime.rates` as functions over records."""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.laws.conversion import gather_wave, hand_over
from tautwave.offline.couple import exchange_waves, filter_from_master, filter_from_slave
from tautwave.offline.records import Body, Couple, PairParams, Side, SideParams
from tautwave.offline.side import close_side, pass_side, receive_side


def is_due(p: SideParams, slot: int) -> bool:
    """Return whether this slot is one in which the axis is read and written."""
    return p.divisor == 1 or slot % p.divisor == p.divisor - 1


def stored_rate(s: Side, p: SideParams) -> float:
    """Return the energy under way in the converter [J]."""
    held = s.left * s.held * s.held
    return p.line_half * (held + s.block * s.block_mean * s.block_mean)


def load_rate(s: Side, p: SideParams, wave: float) -> None:
    """Take the wave that leaves the slow port, to give it away over n slots."""
    s.rate_dissipated += p.line_half * s.left * s.held * s.held
    s.held = wave
    s.left = p.divisor
    s.rate_absorbed += p.line_half * p.divisor * wave * wave


def give_rate(s: Side, p: SideParams) -> float:
    """Return the wave of this slot for the line."""
    if s.left == 0:
        return 0.0
    s.left -= 1
    s.rate_absorbed -= p.line_half * s.held * s.held
    return s.held


def take_rate(s: Side, p: SideParams, wave: float) -> None:
    """Take the wave that the line delivers in this slot."""
    mean, lost = gather_wave(s.block, s.block_mean, wave)
    s.block_mean = mean
    s.block += 1
    s.rate_absorbed += p.line_half * wave * wave
    s.rate_dissipated += p.line_half * lost


def over_rate(s: Side, p: SideParams) -> float:
    """Return the wave for the slow port, and begin a new block."""
    wave, lost = hand_over(p.divisor, s.block, s.block_mean)
    s.rate_dissipated += p.line_half * lost
    s.rate_absorbed -= p.line_half * p.divisor * wave * wave
    s.block_mean = 0.0
    s.block = 0
    return wave


def leave_rated(
    s: Side, p: SideParams, b: Body, table: MutableSequence[float], due: bool, here: bool
) -> float:
    """Close the side if it is due; return the wave for the line. `here`: the loop saw the slot."""
    if due:
        pass_side(s, p, table)
        if here and b.valid:
            close_side(s, p, b.position, b.effort)
        elif here or p.divisor > 1:
            s.valid = False
            s.leaving = 0.0
    if p.divisor > 1:
        if due:
            load_rate(s, p, s.leaving)
        return give_rate(s, p)
    if here:
        return s.leaving
    return 0.0


def arrive_rated(s: Side, p: SideParams, wave: float, due: bool) -> None:
    """Take the wave of this slot from the line."""
    if p.divisor == 1:
        receive_side(s, p, wave)
    else:
        take_rate(s, p, wave)
        if due:
            receive_side(s, p, over_rate(s, p))


def pass_rated(
    c: Couple,
    q: PairParams,
    one: Side,
    two: Side,
    p1: SideParams,
    p2: SideParams,
    master: Body,
    slave: Body,
    table: MutableSequence[float],
    slot: int,
    here: bool,
) -> None:
    """Pass one slot up to `receive`."""
    due_one = is_due(p1, slot)
    due_two = is_due(p2, slot)
    from_master = leave_rated(one, p1, master, table, due_one, here)
    from_slave = leave_rated(two, p2, slave, table, due_two, here)
    if q.filtered and (here or p1.divisor > 1):
        from_master = filter_from_master(c, q, from_master)
    if q.filtered and (here or p2.divisor > 1):
        from_slave = filter_from_slave(c, q, from_slave)
    at_master = from_slave
    at_slave = from_master
    if q.samples > 0:
        at_master, at_slave = exchange_waves(c, q, table, from_master, from_slave)
    arrive_rated(one, p1, at_master, due_one)
    arrive_rated(two, p2, at_slave, due_two)
