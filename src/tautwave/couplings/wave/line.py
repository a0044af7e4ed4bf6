"""What lies between the two ends of a wave pair: a delay line, with its account.

A line delays by a whole number of slots, both ways. A slot that the loop skipped still passes:
nothing enters (a null wave, which is passive), and what leaves is handed over.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.controller.records import PairParams, PairState


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
