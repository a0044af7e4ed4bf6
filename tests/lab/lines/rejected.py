"""Receivers that do not do: a wave held until the next, null waves where one is missing, a buffer.

They play the wave of a slot alone. Holding it invents energy; leaving it out loses position.
"""

from __future__ import annotations

from collections.abc import MutableSequence
from dataclasses import dataclass

from tautwave.laws.counters import WAVE_QUANTUM, apart
from tautwave.laws.receiver import ReceiverParams
from tautwave.link.network import take_copy
from tautwave.link.receiver import PLACE

NULL = 1
BUFFER = 2


@dataclass(slots=True)
class Rejected:
    """Newest slot that came, -1 before; slots from it back to the first one; the wave held."""

    newest: int = -1
    lead: int = 0
    wave: float = 0.0


def play_rejected(
    s: Rejected,
    policy: int,
    p: ReceiverParams,
    table: MutableSequence[float],
    ring: int,
    places: int,
    calendar: int,
    days: int,
    now: int,
    sender_period: float,
) -> float:
    """Take what arrives in a tick and return the wave for the port [W**0.5]."""
    fresh = False
    slot = take_copy(table, calendar, days, now)
    while slot >= 0:
        wave = sent_wave(table, calendar, days, slot, sender_period)
        at = ring + PLACE * (slot % places)
        table[at] = slot
        table[at + 1] = wave
        if slot > s.newest:
            if s.newest < 0:
                s.lead = now * p.down // p.up - slot
            s.newest = slot
            s.wave = wave
            fresh = True
        slot = take_copy(table, calendar, days, now)
    if s.newest < 0:
        return 0.0
    if policy == BUFFER:
        due = (now * p.down - p.depth) // p.up - s.lead
        at = ring + PLACE * (due % places)
        if due >= 0 and int(table[at]) == due:
            return table[at + 1]
        return 0.0
    if policy == NULL and not fresh:
        return 0.0
    return s.wave


def sent_wave(
    table: MutableSequence[float], calendar: int, days: int, slot: int, period: float
) -> float:
    """Return the wave that was sent in a slot [W**0.5]."""
    now = int(table[calendar + 4 * (slot % days)])
    before = 0
    if slot > 0:
        before = int(table[calendar + 4 * ((slot - 1) % days)])
    return apart(now, before) * WAVE_QUANTUM / period
