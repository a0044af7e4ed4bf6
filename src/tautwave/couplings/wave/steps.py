"""The steps of a wave coupling, and what of it is recorded."""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairView
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import Guard, Law, Steps
from tautwave.couplings.wave.port import (
    LIMP,
    LIMP_COARSE,
    LIMP_NOISY,
    LIMP_PLAIN,
    PORT_OVERDRAWN,
    POSITION_DEBT,
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
from tautwave.couplings.wave.rates import exchange_rated, exchange_waves, stored_in_converter
from tautwave.couplings.wave.records import WaveEnd, WaveLink
from tautwave.couplings.wave.rescaling import rescaling


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


def fill_signals(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the waves that arrived and left, as they are on the line."""
    out[at] = s.end.arrived
    out[at + 1] = s.end.leaving
    return at + 2


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


def _limp(why: str) -> Guard:
    """Return a lost coupling, and what most likely took the energy."""
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
        fill_signals=fill_signals,
        fill_elements=fill_elements,
    ),
    end=WaveEnd,
    link=WaveLink,
    signals=("wave_in", "wave_out"),
    elements=element_names,
    guards={
        PORT_OVERDRAWN: Guard(
            "port_overdrawn",
            "drew more energy than its port had",
            "the tank is {found:.3g} J in debt (limit {allowed:.3g} J)",
        ),
        LIMP: _limp(
            "though its encoder is no noisier than declared: it is moved harder than its leak is "
            "made for, too many slots had no sample, or its motor does not follow its "
            "commands; check the limits, the effort_quantum and the inertia that the rig states"
        ),
        LIMP_NOISY: _limp(
            "because its positions jump more than the leak allows, in the last second like noise "
            "of {allowed:.2g} (SI) would: its encoder is noisier than position_noise, or of "
            "another colour (tautwave identify --noise measures it), or it vibrates against "
            "something stiffer than the rig states"
        ),
        LIMP_COARSE: _limp(
            "because its effort_quantum is above {allowed:.3g}, the coarsest that works here"
        ),
        LIMP_PLAIN: _limp(
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
