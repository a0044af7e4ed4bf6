"""The steps of a wave coupling, and what of it is recorded.

The line between the ends of a wave pair, and pairs with a slow side.

A line delays by a whole number of slots, both ways. A slot that the loop skipped still passes:
what left last enters again, paid for by its port, and what leaves is handed over.

A slow side: its bus is served every n-th slot, the line every slot.

At slot j n the bus gets its request, at slot j n + n - 1 its response is there: the port closes,
takes the mean of the waves of the last n slots, thinks, and its leaving wave is held for the n
slots from there on. What it decides goes out with the next request. The converter between line and
slow port keeps an account; its state is the `rate_` part of the end's.

Another scale for an end that runs: its tank by `laws.port.port_rescale`, books and pipe.

Waves on the line stay what they are, in the pair's units; those that have reached the device, and
whose commands have still to act, are the same waves in its new units. Efforts under way are the
device's own, and are booked as they act: the tank pays for what they are worth by then.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence

from tautwave.columns import Column
from tautwave.contracts import Row
from tautwave.controller.records import (
    PIPE,
    TAG,
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    PairView,
)
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import Guard, Law, Rescaling, Steps, fill_each
from tautwave.couplings.wave.port import (
    PORT_OVERDRAWN,
    PORT_STARVED,
    PORT_STARVED_COARSE,
    PORT_STARVED_NOISY,
    PORT_STARVED_PLAIN,
    POSITION_DEBT,
    WaveEnd,
    WaveEndParams,
    WaveLink,
    brake,
    close,
    compute_effort,
    move,
    on_acted,
    on_missing,
    receive_wave,
    repeat_wave,
    start_end,
    waiting_energy,
)
from tautwave.laws.conversion import gather_wave, hand_over
from tautwave.laws.port import port_rescale

FUNDED = 0.05
"""Share of the new reserve without which an end rather lets go, and begins with all of it."""


def hindrance(s: AxisState, p: AxisParams, new: WaveEndParams, ratio: float) -> str:
    """Say why an end cannot take another scale now, '' if it can."""
    if not p.impedance:
        return "it takes velocities"
    kept, _, _, _ = port_rescale(s.end.account, 0.0, 0.0, ratio)
    if not kept >= FUNDED * new.port.reserve:
        return "its tank is too empty"
    return ""


def keep(old: WaveEndParams, new: WaveEndParams) -> WaveEndParams:
    """Return constants of another scale with the filter as it is tuned now."""
    port = new.port._replace(filter_gain=old.port.filter_gain, kept=old.port.kept)
    return new._replace(port=port)


def carry(s: AxisState, p: AxisParams, ratio: float, table: MutableSequence[float]) -> None:
    """Change an end's state; a second that was watched counts anew."""
    e = s.end
    root = math.sqrt(ratio)
    e.account, e.gap, e.filtered, lost = port_rescale(e.account, e.gap, e.filtered, ratio)
    e.reserve *= ratio
    e.port_absorbed *= ratio
    e.damper_dissipated *= ratio
    e.leaked *= ratio
    e.spilled = ratio * e.spilled + lost
    e.wave_sum *= root
    e.wave_energy *= ratio
    e.wave_in *= root
    s.tag *= root
    for at in range(p.pipe, p.pipe + PIPE * p.delay, PIPE):
        table[at + TAG] *= root
    e.wanted_sum = e.cut_sum = e.gap_sum = e.gap_before = 0.0
    e.watch_left = e.owing = 0
    e.cut_before = False


rescaling = Rescaling(hindrance, keep, carry)


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


def start(pair: PairView, gap: float) -> None:
    """Begin with nothing on its way; the slave's port mends the `gap` [rad or m]."""
    one, two, p1, p2 = pair.one, pair.two, pair.p1, pair.p2
    start_end(one, p1, 0.0)
    start_end(two, p2, gap)


def engage(pair: PairView) -> None:
    """Let nothing arrive."""
    one, two, p1, p2 = pair.one, pair.two, pair.p1, pair.p2
    receive_wave(one, p1, 0.0)
    receive_wave(two, p2, 0.0)


def exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass one slot: leaving waves enter the line, what leaves it arrives.

    Once for every slot of the loop, seen or not: the line's delay is so many slots. A slot that
    the loop slept through repeats the last wave where the tank pays for it. Without a line
    (`samples` 0) each wave arrives in the slot in which it left.
    """
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    if q.rated:
        exchange_rated(pair, here, due_one, due_two)
        return
    if here:
        from_master = one.end.leaving
        from_slave = two.end.leaving
    else:
        from_master = repeat_wave(one, p1)
        from_slave = repeat_wave(two, p2)
    at_master = from_slave
    at_slave = from_master
    if q.samples > 0:
        at_master, at_slave = exchange_waves(c, q, table, from_master, from_slave)
    receive_wave(one, p1, at_master)
    receive_wave(two, p2, at_slave)


def has_damper(p: AxisParams) -> bool:
    """Return whether a damper stands in series with the port, so that no wave is reflected."""
    return p.end.port.slip > 0.0 and p.impedance


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the names of a pair's elements in the order of their columns."""
    sides = (("master", p1), ("slave", p2))
    names: list[str] = []
    for side, p in sides:
        names.append(f"port_{side}")
        if has_damper(p):
            names.append(f"damper_{side}")
    names += [f"converter_{side}" for side, p in sides if p.divisor > 1]
    if q.samples > 0:
        names.append("line")
    return names


SIGNALS = (
    Column("wave_in", "W^½", "the wave that arrived", lambda s, p: s.end.arrived),
    Column("wave_out", "W^½", "the wave that left", lambda s, p: s.end.leaving),
)
"""What is recorded of an axis."""

ACCOUNTS = {
    "port_SIDE": "wave port, with its tank",
    "damper_SIDE": "matched termination",
    "converter_SIDE": "between the rates of the line and a slower bus",
    "line": "delay line: waves in transit",
}
"""What the elements of a pair are."""


def fill_tank(out: Row, at: int, s: AxisState, p: AxisParams, table: MutableSequence[float]) -> int:
    """Write the accounts of a port with its tank, and of its series damper."""
    e = s.end
    weight = p.weight
    waiting = waiting_energy(s, p, table)
    at = fill_element(
        out,
        at,
        weight * (e.port_absorbed + waiting),
        weight * (e.account - e.reserve + waiting),
        weight * (e.spilled - e.leaked),
    )
    if has_damper(p):
        lost = weight * e.damper_dissipated
        at = fill_element(out, at, lost, 0.0, lost)
    return at


def fill_converter(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the account of a rate converter, if there is one."""
    if p.divisor == 1:
        return at
    e = s.end
    return fill_element(out, at, e.rate_absorbed, stored_in_converter(s, p), e.rate_dissipated)


def fill_elements(out: Row, at: int, pair: PairView) -> int:
    """Write the accounts of ports, converters and line."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    at = fill_tank(out, at, one, p1, table)
    at = fill_tank(out, at, two, p2, table)
    at = fill_converter(out, at, one, p1)
    at = fill_converter(out, at, two, p2)
    if q.samples > 0:
        at = fill_element(out, at, c.link.line_energy, c.link.line_energy, 0.0)
    return at


def _port_starved(why: str) -> Guard:
    """Return the guard of a starved port; `why`: what most likely took the energy."""
    lost = "its port could not cover {found:.3g} % of the energy of the last second's waves"
    return Guard("port_starved", "lost its coupling", f"{lost}, {why}")


law = Law(
    name="wave",
    steps=Steps(
        start=start,
        engage=engage,
        on_acted=on_acted,
        close=close,
        on_missing=on_missing,
        exchange=exchange,
        compute_effort=compute_effort,
        move=move,
        brake=brake,
        fill_signals=fill_each(SIGNALS),
        fill_elements=fill_elements,
    ),
    end=WaveEnd,
    link=WaveLink,
    signals=SIGNALS,
    elements=element_names,
    accounts=ACCOUNTS,
    guards={
        PORT_OVERDRAWN: Guard(
            "port_overdrawn",
            "drew more energy than its port had",
            "the tank is {found:.3g} J in debt (limit {allowed:.3g} J)",
        ),
        PORT_STARVED: _port_starved(
            "though its encoder is no noisier than declared: it is moved harder than its leak is "
            "made for, too many slots had no sample, or its motor does not follow its "
            "commands; check the limits, the effort_quantum and the inertia that the rig states"
        ),
        PORT_STARVED_NOISY: _port_starved(
            "because its positions jump more than the leak allows, in the last second like noise "
            "of {allowed:.2g} (SI) would: its encoder is noisier than position_noise, or of "
            "another colour (tautwave identify --noise measures it), or it vibrates against "
            "something stiffer than the rig states"
        ),
        PORT_STARVED_COARSE: _port_starved(
            "because its effort_quantum is above {allowed:.3g}, the coarsest that works here"
        ),
        PORT_STARVED_PLAIN: _port_starved(
            "because work in one direction empties the tank of a plain port; give it a pole"
        ),
        POSITION_DEBT: Guard(
            "position_debt",
            "lost its coupling",
            "its port owes the other end a displacement of {found:.3g} that does not shrink (limit "
            "{allowed:.3g})",
        ),
    },
    rings=2,
    rescaling=rescaling,
)
