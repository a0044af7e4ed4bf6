"""A law of what each side sees of the other at one of two sites: packets of a real network.

What came last, and what of it was heard last, stand at the two first places of the slots that the
other end would have sent.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence
from typing import Any

from tautwave.controller.records import AxisParams, AxisState, PairView
from tautwave.controller.steps import Law, SiteLaw
from tautwave.controller.wrapping import bound
from tautwave.couplings.over_link.law import (
    NewsEnd,
    NewsEndParams,
    NewsParams,
    credit_heard,
    law_credit,
    law_hear,
    law_level,
    law_shown,
    linked_law,
    pass_time,
    say,
    see_master,
    see_slave,
)
from tautwave.link.network import SENT
from tautwave.link.news import level_heard, motion_heard
from tautwave.link.packet import Line
from tautwave.link.post import last_line, put_line

NEVER = 1 << 50
CAME, HEARD = 0, 1


def listen(e: NewsEnd, k: NewsEndParams, table: MutableSequence[float]) -> int:
    """Return where the newest word stands, -1 if it was heard before."""
    slot = e.network.heard
    if slot <= e.heard:
        return -1
    e.heard = slot
    e.silent = 0
    came, heard = (k.post + SENT * place for place in (CAME, HEARD))
    table[heard : heard + SENT] = table[came : came + SENT]
    return heard


def exchange_master(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Hear and say at the master's end; the slave's is not looked at."""
    c, q, one, p1, table = pair.c, pair.q, pair.one, pair.p1, pair.table
    w, k = c.link.news, q.link
    w.cleared = False
    at = listen(w.master, k.master, table)
    if at >= 0:
        see_slave(one.end, q, c.offset, table, at)
        level = level_heard(int(table[at + 3]))
        law_hear(one, p1, credit_heard(w.master, int(table[at + 2])), level)
    slot = w.master.slot
    pass_time(w.master, k.master, one, q.period)
    x, v = law_shown(one)
    credit, level = law_credit(one, p1), law_level(one, p1)
    say(w.slave, k.slave, slot, k.period_ns, (x, v, one.end.effort, credit, level), table, False)


def exchange_slave(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Hear and say at the slave's end; the master's is not looked at."""
    c, q, two, p2, table = pair.c, pair.q, pair.two, pair.p2, pair.table
    w, k = c.link.news, q.link
    w.cleared = False
    at = listen(w.slave, k.slave, table)
    if at >= 0:
        see_master(two.end, q, c.offset, table, at)
        level = level_heard(int(table[at + 3]))
        law_hear(two, p2, credit_heard(w.slave, int(table[at + 2])), level)
    slot = w.slave.slot
    pass_time(w.slave, k.slave, two, q.period)
    x, v = law_shown(two)
    credit, level = law_credit(two, p2), law_level(two, p2)
    say(w.master, k.master, slot, k.period_ns, (x, v, two.end.effort, credit, level), table, False)


def patient(k: NewsParams) -> NewsParams:
    """Return constants of a link that waits: whether the other site is lost is the session's."""
    return k._replace(master=k.master._replace(lost=NEVER), slave=k.slave._replace(lost=NEVER))


def ends(w: Any) -> tuple[NewsEnd, NewsEnd]:
    """Return the master's end and the slave's."""
    return w.news.master, w.news.slave


def begin(w: Any) -> None:
    """Let the next start be that of a new session."""
    w.news.cleared = False


def take(
    e: NewsEnd, k: NewsEndParams, table: MutableSequence[float], slot: int, line: Line
) -> None:
    """Take a line of a packet that came: an older one than the newest says nothing."""
    if slot > e.network.heard:
        e.network.heard = slot
        put_line(table, k.post, 1, CAME, line._replace(pairs=line.pairs[:1]))
    e.network.arrived += 1


def said(far: NewsEndParams, table: MutableSequence[float]) -> tuple[int, Line]:
    """Return the last slot, and what its packet says to the `far` end."""
    slot = int(table[far.last])
    return slot, last_line(table, far.post, far.days, slot, far.repeated)


def owed(
    e: NewsEnd, k: NewsEndParams, table: MutableSequence[float], s: AxisState, p: AxisParams
) -> float:
    """Return by how much the far side moved between the words [rad or m, master]."""
    if e.heard < 0 or e.network.heard <= e.heard:
        return 0.0
    came, heard = (motion_heard(int(table[k.post + SENT * place])) for place in (CAME, HEARD))
    return k.position * math.fabs(came - heard)


def site_laws(law: Law) -> dict[str, SiteLaw]:
    """Return a law made by `controller.seen` as it is at either of two sites."""
    linked = linked_law(law)
    shown = {"law_shown": law.shown}
    return {
        side: SiteLaw(
            linked._replace(steps=linked.steps._replace(exchange=bound(exchange, shown))),
            patient, ends, begin, take, said, owed, frozenset(),
        )
        for side, exchange in (("master", exchange_master), ("slave", exchange_slave))
    }  # fmt: skip
