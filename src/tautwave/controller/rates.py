"""Pairs with a slow side: its bus is served every n-th slot, the line every slot.

At slot j n the bus is asked, at slot j n + n - 1 its answer is there: the port closes, takes the
mean of the waves of the last n slots, thinks, and its leaving wave is held for the n slots from
there on. What it decides goes out with the next request. The converter between line and slow port
keeps an account; its state is the `rate_` part of the axis'.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.axis import miss_sample, pass_slot, receive_wave, take_sample
from tautwave.controller.line import exchange_waves, filter_from_master, filter_from_slave
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, Sample
from tautwave.laws.conversion import gather_wave, hand_over


def is_due(p: AxisParams, slot: int) -> bool:
    """Return whether this slot is one in which the axis is read and written."""
    return p.divisor == 1 or slot % p.divisor == p.divisor - 1


def stored_in_converter(s: AxisState, p: AxisParams) -> float:
    """Return the energy under way in the converter [J]."""
    held = s.rate_left * s.rate_held * s.rate_held
    return p.line_half * (held + s.rate_count * s.rate_mean * s.rate_mean)


def load_wave(s: AxisState, p: AxisParams, wave: float) -> None:
    """Take the wave that leaves the slow port, to give it away over n slots."""
    # Nothing is left but when the port closes out of turn.
    s.rate_dissipated += p.line_half * s.rate_left * s.rate_held * s.rate_held
    s.rate_held = wave
    s.rate_left = p.divisor
    s.rate_absorbed += p.line_half * p.divisor * wave * wave


def give_wave(s: AxisState, p: AxisParams) -> float:
    """Return the wave of this slot for the line."""
    if s.rate_left == 0:
        return 0.0
    s.rate_left -= 1
    s.rate_absorbed -= p.line_half * s.rate_held * s.rate_held
    return s.rate_held


def take_wave(s: AxisState, p: AxisParams, wave: float) -> None:
    """Take the wave that the line delivers in this slot."""
    mean, lost = gather_wave(s.rate_count, s.rate_mean, wave)
    s.rate_mean = mean
    s.rate_count += 1
    s.rate_absorbed += p.line_half * wave * wave
    s.rate_dissipated += p.line_half * lost


def hand_over_wave(s: AxisState, p: AxisParams) -> float:
    """Return the wave for the slow port, and begin a new block."""
    wave, lost = hand_over(p.divisor, s.rate_count, s.rate_mean)
    s.rate_dissipated += p.line_half * lost
    s.rate_absorbed -= p.line_half * p.divisor * wave * wave
    s.rate_mean = 0.0
    s.rate_count = 0
    return wave


def leave_rated(
    s: AxisState, p: AxisParams, m: Sample, table: MutableSequence[float], due: bool, here: bool
) -> float:
    """Close the side if it is due; return the wave for the line. `here`: the loop saw the slot."""
    if due:
        pass_slot(s, p, table)
        if here:
            take_sample(s, p, m)
        elif p.divisor > 1:
            miss_sample(s)
    if p.divisor > 1:
        if due:
            load_wave(s, p, s.leaving)
        return give_wave(s, p)
    if here:
        return s.leaving
    return 0.0


def arrive_rated(s: AxisState, p: AxisParams, wave: float, due: bool) -> None:
    """Take the wave of this slot from the line."""
    if p.divisor == 1:
        receive_wave(s, p, wave)
    else:
        take_wave(s, p, wave)
        if due:
            receive_wave(s, p, hand_over_wave(s, p))


def pass_rated(
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
