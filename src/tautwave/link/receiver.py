"""Sender and receiver of one wave line as records, and the ring of received slots.

The ring lies in a table of floats, three to a place: slot, integral, energy. The steps are those
of `laws.receiver`; live and compiled call the same functions.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence
from dataclasses import dataclass

from tautwave.laws.counters import (
    ENERGY_QUANTUM,
    WAVE_QUANTUM,
    added,
    apart,
    charged,
    credited,
    rounded_wave,
)
from tautwave.laws.receiver import (
    LOWEST,
    ReceiverParams,
    adapt_depth,
    advance,
    output_wave,
    part_of,
    surplus,
    timely_wave,
    wanted_wave,
    watched,
)

PLACE = 3
"""Floats of a slot in the ring."""
EMPTY = -1.0


@dataclass(slots=True)
class Sender:
    """What left a port since the session began, as it is on the wire; `slot` is the last one."""

    slot: int = -1
    integral: int = 0
    energy: int = 0
    residue: float = 0.0
    fraction: float = 0.0


@dataclass(slots=True)
class Receiver:
    """Where a receiver stands.

    `pointer` is played up to, with the counters `played` and `paid` there; `newest` is the last
    slot that came, -1 before. `given` and `spent` are what it gave out; `growth` came in time in
    the last tick, `mean` lately. The pointer aims at `depth`, for `since` ticks; `dry` and `thin`
    are the shares of them for which it was too short, or would have been with a slot less.
    `granted` is energy that it sent back, `asked` how much in all it would take; `was_granted`
    and `was_asked` are the other site's. `dropped` [J] is energy that was not wanted; `short`:
    the last tick could not pay for all that it wanted.
    """

    newest: int = -1
    pointer: int = 0
    played: int = 0
    paid: int = 0
    given: int = 0
    spent: int = 0
    growth: int = 0
    mean: float = 0.0
    best: int = LOWEST
    ticks: int = 0
    owed: int = 0
    depth: int = 0
    since: int = 0
    granted: int = 0
    asked: int = 0
    was_granted: int = 0
    was_asked: int = 0
    prepaid: float = 0.0
    dropped: float = 0.0
    dry: float = 0.0
    thin: float = 0.0
    begun: bool = False
    short: bool = False


def start_sender(s: Sender) -> None:
    """Begin a session: nothing was sent."""
    s.slot = -1
    s.integral = 0
    s.energy = 0
    s.residue = 0.0
    s.fraction = 0.0


def start_receiver(s: Receiver, table: MutableSequence[float], ring: int, size: int) -> None:
    """Begin a session: nothing stored passes from one to the next."""
    s.newest = -1
    s.pointer = 0
    s.played = 0
    s.paid = 0
    s.given = 0
    s.spent = 0
    s.growth = 0
    s.mean = 0.0
    s.best = LOWEST
    s.ticks = 0
    s.owed = 0
    s.depth = 0
    s.since = 0
    s.granted = 0
    s.asked = 0
    s.was_granted = 0
    s.was_asked = 0
    s.prepaid = 0.0
    s.dropped = 0.0
    s.dry = 0.0
    s.thin = 0.0
    s.begun = False
    s.short = False
    for i in range(size):
        table[ring + PLACE * i] = EMPTY


def send(s: Sender, period: float, wave: float) -> None:
    """Count the wave [W**0.5] that leaves in the next slot of T [s] and was paid by its port."""
    change, s.residue = rounded_wave(wave, period, s.residue)
    energy, s.fraction = credited(0.5 * period * wave * wave / ENERGY_QUANTUM, s.fraction)
    s.slot += 1
    s.integral = added(s.integral, change)
    s.energy = added(s.energy, energy)


def ring_size(p: ReceiverParams) -> int:
    """Return the places that a receiver's ring needs."""
    return (p.deepest + p.far) // p.up + p.down + 2


def take_pair(
    s: Receiver,
    p: ReceiverParams,
    table: MutableSequence[float],
    ring: int,
    size: int,
    slot: int,
    integral: int,
    energy: int,
) -> None:
    """Keep the counters of a slot; what was played already, or fell out of the ring, is past."""
    if slot <= s.newest - size or (s.begun and slot * p.up <= s.pointer):
        return
    at = ring + PLACE * (slot % size)
    table[at] = slot
    table[at + 1] = integral
    table[at + 2] = energy
    if slot > s.newest:
        s.newest = slot


def take_credit(s: Receiver, granted: int, asked: int) -> None:
    """Keep what the other site's newest packet says about credit."""
    s.was_granted = granted
    s.was_asked = asked


def play_to(
    s: Receiver,
    p: ReceiverParams,
    table: MutableSequence[float],
    ring: int,
    size: int,
    target: int,
) -> None:
    """Move the pointer to a step that is not beyond the newest slot, along straight lines."""
    start = max(s.pointer, -p.up)
    s.pointer = target
    if target <= start:
        return
    slot = -((-target) // p.up)  # the first one there or after
    at = ring + PLACE * (slot % size)
    while int(table[at]) != slot:
        slot += 1
        at = ring + PLACE * (slot % size)
    steps = target - start
    whole = slot * p.up - start
    s.played = added(s.played, part_of(apart(int(table[at + 1]), s.played), steps, whole))
    # A late packet may lie below the line that was taken before; what came stays, since E grows.
    s.paid = added(s.paid, part_of(max(0, apart(int(table[at + 2]), s.paid)), steps, whole))


def funds_of(s: Receiver, p: ReceiverParams) -> int:
    """Return what a receiver may spend [energy quanta]."""
    return apart(added(s.paid, s.was_granted), s.spent) + p.reserve


def tick(
    s: Receiver, p: ReceiverParams, table: MutableSequence[float], ring: int, size: int
) -> float:
    """Play one tick and return the wave for the port [W**0.5]."""
    if s.newest < 0:
        return 0.0
    if not s.begun:
        s.begun = True
        s.depth = p.depth
        s.pointer = min(-p.up, s.newest * p.up - p.depth - p.down)
    before = s.played
    ahead = s.newest * p.up - s.pointer
    if p.deepest > p.depth:
        follow_network(s, p, ahead)
    step, timely, s.best, s.ticks, s.owed = advance(p, s.depth, ahead, s.best, s.ticks, s.owed)
    growth = s.growth
    if timely >= 0:
        paid = s.paid
        play_to(s, p, table, ring, size, s.pointer + timely)
        growth = apart(s.played, before)
        if timely > p.down:
            growth = timely_wave(p, growth, apart(s.paid, paid))
        step -= timely
    if step > 0:
        play_to(s, p, table, ring, size, s.pointer + step)
    s.growth = growth
    s.mean += p.smooth * (growth - s.mean)
    funds = funds_of(s, p)
    rest = apart(s.played, s.given) - growth
    want = wanted_wave(p, rest, growth)
    wave = output_wave(p, funds, rest, growth, s.mean, want)
    s.short = math.fabs(want - wave) >= 2.0
    cost, s.prepaid = charged(p.scale * (1.0 * wave * wave), s.prepaid)
    s.given = added(s.given, wave)
    s.spent = added(s.spent, cost)
    settle(s, p, funds - cost)
    return wave * WAVE_QUANTUM / p.period


def follow_network(s: Receiver, p: ReceiverParams, ahead: int) -> None:
    """Watch how often a tick is dry, and change the depth at the end of a block."""
    s.dry = watched(p, s.dry, ahead < p.down, s.since)
    s.thin = watched(p, s.thin, ahead < p.down + p.up, s.since)
    s.since += 1
    if s.owed == 0 and s.ticks + 1 >= p.block:
        depth = adapt_depth(p, s.depth, s.best, s.dry, s.thin, s.since)
        if depth != s.depth:
            s.depth = depth
            s.since = 0
            s.dry = 0.0
            s.thin = 0.0


def settle(s: Receiver, p: ReceiverParams, funds: int) -> None:
    """Send back what is more than enough, as far as the other site wants it; say what is missing.

    Kept, it would be energy that nobody accounts for: a loss averages waves, and leaves theirs.
    """
    spare = surplus(p, funds, apart(s.played, s.given))
    if spare > 0:
        wanted = apart(s.was_asked, s.granted)
        grant = max(0, min(spare, wanted))
        s.granted = added(s.granted, grant)
        s.spent = added(s.spent, spare)
        s.dropped += (spare - grant) * ENERGY_QUANTUM
    s.asked = added(s.was_granted, max(0, p.reserve + p.level - funds))
