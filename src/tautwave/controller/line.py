"""What lies between the two axes of a pair: delay line and wave filters, with their accounts.

A line delays by a whole number of slots, both ways. A slot that the loop skipped still passes:
nothing enters (a null wave, which is passive), and what leaves is handed over.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.records import AxisState, PairParams, PairState
from tautwave.laws.wave_filter import filter_step


def exchange_waves(
    c: PairState,
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
    c: PairState, q: PairParams, one: AxisState, two: AxisState, table: MutableSequence[float]
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


def filter_waves(
    c: PairState, q: PairParams, from_master: float, from_slave: float
) -> tuple[float, float]:
    """Low-pass both leaving waves and book them."""
    return filter_from_master(c, q, from_master), filter_from_slave(c, q, from_slave)


def filter_from_master(c: PairState, q: PairParams, wave: float) -> float:
    """Low-pass the wave that leaves the master and book it."""
    u, stored, lost = filter_step(q.filter_gain, q.period, c.filter_master, wave)
    c.filter_master = u
    c.filter_master_stored = stored
    c.filter_master_dissipated += lost
    c.filter_master_absorbed += q.half_period * (wave * wave - u * u)
    return u


def filter_from_slave(c: PairState, q: PairParams, wave: float) -> float:
    """Low-pass the wave that leaves the slave and book it."""
    u, stored, lost = filter_step(q.filter_gain, q.period, c.filter_slave, wave)
    c.filter_slave = u
    c.filter_slave_stored = stored
    c.filter_slave_dissipated += lost
    c.filter_slave_absorbed += q.half_period * (wave * wave - u * u)
    return u
