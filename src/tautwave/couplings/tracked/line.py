"""What lies between the two ends of a wave pair: delay line and wave filters, with their accounts.

A line delays by a whole number of slots, both ways. A slot that the loop skipped still passes:
nothing enters (a null wave, which is passive), and what leaves is handed over.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.records import PairParams, PairState
from tautwave.laws.wave_filter import filter_step


def exchange_waves(
    c: PairState,
    q: PairParams,
    table: MutableSequence[float],
    from_master: float,
    from_slave: float,
) -> tuple[float, float]:
    """Pass one slot on the wave line; return the waves arriving at (master, slave)."""
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


def filter_waves(
    c: PairState, q: PairParams, from_master: float, from_slave: float
) -> tuple[float, float]:
    """Low-pass both leaving waves and book them."""
    return filter_from_master(c, q, from_master), filter_from_slave(c, q, from_slave)


def filter_from_master(c: PairState, q: PairParams, wave: float) -> float:
    """Low-pass the wave that leaves the master and book it."""
    w = c.link
    u, stored, lost = filter_step(q.link.filter_gain, q.period, w.filter_master, wave)
    w.filter_master = u
    w.filter_master_stored = stored
    w.filter_master_dissipated += lost
    w.filter_master_absorbed += q.half_period * (wave * wave - u * u)
    return u


def filter_from_slave(c: PairState, q: PairParams, wave: float) -> float:
    """Low-pass the wave that leaves the slave and book it."""
    w = c.link
    u, stored, lost = filter_step(q.link.filter_gain, q.period, w.filter_slave, wave)
    w.filter_slave = u
    w.filter_slave_stored = stored
    w.filter_slave_dissipated += lost
    w.filter_slave_absorbed += q.half_period * (wave * wave - u * u)
    return u
