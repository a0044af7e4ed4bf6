"""The line between the ends of a wave pair, and pairs with a slow side.

A line delays by a whole number of slots, both ways. A slot that the loop skipped still passes:
what left last enters again, paid for by its port, and what leaves is handed over.

A slow side: its bus is served every n-th slot, the line every slot.

At slot j n the bus gets its request, at slot j n + n - 1 its response is there: the port closes,
takes the mean of the waves of the last n slots, thinks, and its leaving wave is held for the n
slots from there on. What it decides goes out with the next request. The converter between line and
slow port keeps an account; its state is the `rate_` part of the end's.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, PairView
from tautwave.couplings.wave.port import receive_wave, repeat_wave
from tautwave.laws.conversion import gather_wave, hand_over


def exchange_waves(
    c: PairState,
    q: PairParams,
    table: MutableSequence[float],
    from_master: float,
    from_slave: float,
) -> tuple[float, float]:
    """Pass one slot on the wave line; return the waves arriving at (master, slave).

    Two rings of `samples` waves in the pair's table, one each way, with one index: what stands
    there is as old as the line is long, is taken out, and replaced by what enters. Its energy is
    half a period times the sum of squares, kept up by what enters and leaves, so the line's book
    needs no sum over its length.
    """
    w = c.link
    ahead = q.line + w.at
    back = ahead + q.samples
    at_slave = table[ahead]
    at_master = table[back]
    table[ahead] = from_master
    table[back] = from_slave
    w.at += 1
    if w.at == q.samples:
        w.at = 0
    w.line_energy += q.half_period * (
        from_master * from_master
        + from_slave * from_slave
        - at_slave * at_slave
        - at_master * at_master
    )
    return at_master, at_slave


def stored_in_converter(s: AxisState, p: AxisParams) -> float:
    """Return the energy under way in the converter [J]."""
    e = s.end
    held = e.rate_left * e.rate_held * e.rate_held
    stored: float = p.half_slot * (held + e.rate_count * e.rate_mean * e.rate_mean)
    return stored


def load_wave(s: AxisState, p: AxisParams, wave: float) -> None:
    """Take the wave that leaves the slow port, to give it away over n slots."""
    e = s.end
    # Nothing is left but when the port closes out of turn.
    e.rate_dissipated += p.half_slot * e.rate_left * e.rate_held * e.rate_held
    e.rate_held = wave
    e.rate_left = p.divisor
    e.rate_absorbed += p.half_slot * p.divisor * wave * wave


def give_wave(s: AxisState, p: AxisParams) -> float:
    """Return the wave of this slot for the line."""
    e = s.end
    if e.rate_left == 0:
        return 0.0
    e.rate_left -= 1
    e.rate_absorbed -= p.half_slot * e.rate_held * e.rate_held
    held: float = e.rate_held
    return held


def take_wave(s: AxisState, p: AxisParams, wave: float) -> None:
    """Take the wave that the line delivers in this slot."""
    e = s.end
    mean, lost = gather_wave(e.rate_count, e.rate_mean, wave)
    e.rate_mean = mean
    e.rate_count += 1
    e.rate_absorbed += p.half_slot * wave * wave
    e.rate_dissipated += p.half_slot * lost


def hand_over_wave(s: AxisState, p: AxisParams) -> float:
    """Return the wave for the slow port, and begin a new block."""
    e = s.end
    wave, lost = hand_over(p.divisor, e.rate_count, e.rate_mean)
    e.rate_dissipated += p.half_slot * lost
    e.rate_absorbed -= p.half_slot * p.divisor * wave * wave
    e.rate_mean = 0.0
    e.rate_count = 0
    return wave


def leave_rated(s: AxisState, p: AxisParams, due: bool, here: bool) -> float:
    """Return the wave of this slot for the line. `here`: the loop saw the slot."""
    if p.divisor > 1:
        if due:
            load_wave(s, p, s.end.leaving)
        return give_wave(s, p)
    if here:
        leaving: float = s.end.leaving
        return leaving
    return repeat_wave(s, p)


def arrive_rated(s: AxisState, p: AxisParams, wave: float, due: bool) -> None:
    """Take the wave of this slot from the line."""
    if p.divisor == 1:
        receive_wave(s, p, wave)
    else:
        take_wave(s, p, wave)
        if due:
            receive_wave(s, p, hand_over_wave(s, p))


def exchange_rated(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass one slot of a pair with a slow side."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    from_master = leave_rated(one, p1, due_one, here)
    from_slave = leave_rated(two, p2, due_two, here)
    at_master = from_slave
    at_slave = from_master
    if q.samples > 0:
        at_master, at_slave = exchange_waves(c, q, table, from_master, from_slave)
    arrive_rated(one, p1, at_master, due_one)
    arrive_rated(two, p2, at_slave, due_two)
