"""Law wave at one of two sites: its own end only; packets come from and go to a real network."""

from __future__ import annotations

import math
from collections.abc import MutableSequence

from tautwave.controller.records import AxisParams, AxisState, PairView
from tautwave.controller.steps import SiteLaw
from tautwave.couplings.wave.link.law import (
    LinkEnd,
    LinkEndParams,
    LinkPair,
    LinkParams,
    law,
    pass_end,
    take_note,
)
from tautwave.couplings.wave.port import LIMP, PORT_OVERDRAWN, POSITION_DEBT
from tautwave.laws.counters import WAVE_QUANTUM, apart
from tautwave.link.network import keep_sent
from tautwave.link.packet import Line
from tautwave.link.post import last_line
from tautwave.link.receiver import PLACE, take_credit, take_pair

NEVER = 1 << 50


def keep_last(e: LinkEnd, far: LinkEndParams, table: MutableSequence[float]) -> None:
    """Keep this end's message to the `far` one where packets are made."""
    keep_sent(table, far.post, far.days, e.sender, e.receiver.granted, e.receiver.asked)
    table[far.last] = e.sender.slot


def exchange_master(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass one slot at the master's end; the slave's is not looked at."""
    c, q, one, p1, table = pair.c, pair.q, pair.one, pair.p1, pair.table
    pass_end(c.link.master, q.link.master, one, p1, q, here, due_one, table)
    keep_last(c.link.master, q.link.slave, table)


def exchange_slave(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass one slot at the slave's end; the master's is not looked at."""
    c, q, two, p2, table = pair.c, pair.q, pair.two, pair.p2, pair.table
    pass_end(c.link.slave, q.link.slave, two, p2, q, here, due_two, table)
    keep_last(c.link.slave, q.link.master, table)


def patient(k: LinkParams) -> LinkParams:
    """Return constants of a link that waits: whether the other site is lost is the session's."""
    return k._replace(master=k.master._replace(lost=NEVER), slave=k.slave._replace(lost=NEVER))


def ends(w: LinkPair) -> tuple[LinkEnd, LinkEnd]:
    """Return the master's end and the slave's."""
    return w.master, w.slave


def begin(w: LinkPair) -> None:
    """Let the next start be that of a new session."""
    w.used = False


def take(
    e: LinkEnd, k: LinkEndParams, table: MutableSequence[float], slot: int, line: Line
) -> None:
    """Take a line of a packet that came."""
    r = e.receiver
    before = r.newest
    for back, (integral, energy) in enumerate(line.pairs):
        take_pair(r, k.receiver, table, k.ring, k.places, slot - back, integral, energy)
    if slot > before:
        take_credit(r, line.granted, line.asked)
    take_note(e, k, before, table)


def said(far: LinkEndParams, table: MutableSequence[float]) -> tuple[int, Line]:
    """Return the last slot, and what its packet says to the `far` end."""
    slot = int(table[far.last])
    return slot, last_line(table, far.post, far.days, slot, far.repeated)


def owed(
    e: LinkEnd, k: LinkEndParams, table: MutableSequence[float], s: AxisState, p: AxisParams
) -> float:
    """Return the motion that is missing [rad or m, master]: not given out here, or not sent yet."""
    r = e.receiver
    unsent = math.fabs(s.end.gap / p.end.wave) * k.position / WAVE_QUANTUM
    if r.newest < 0:
        return unsent
    newest = int(table[k.ring + PLACE * (r.newest % k.places) + 1])
    return max(unsent, math.fabs(k.position * apart(newest, r.given)))


DEBTS = frozenset((PORT_OVERDRAWN, LIMP, POSITION_DEBT))
"""Guards of a port that cannot repay: what a silence of either site may leave."""

site_laws = {
    side: SiteLaw(
        law._replace(steps=law.steps._replace(exchange=exchange)),
        patient,
        ends,
        begin,
        take,
        said,
        owed,
        DEBTS,
    )
    for side, exchange in (("master", exchange_master), ("slave", exchange_slave))
}
