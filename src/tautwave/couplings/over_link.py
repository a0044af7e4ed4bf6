"""A law of what each side sees of the other, over a network: state, steps, one site, constants.

In every slot each end says where it stands, how fast it is, the effort that it shows, and of an
account the credit ever sent and its level. The newest word supersedes all older ones, so loss,
order and repetition change nothing but the time. Without a word for `silence` slots the far side
counts as standing where it was.

`law_...` are functions of the law inside and of what surrounds it.

At one of two sites packets come from a real network: what came last, and what of it was heard last,
stand at the two first places of the slots that the other end would have sent.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from tautwave.config.keys.link import Link
from tautwave.contracts import Row
from tautwave.controller.records import NEVER, AxisParams, AxisState, PairParams, PairView
from tautwave.controller.seen import SeenEnd, book_spring, no_spring, where_it_is
from tautwave.controller.steps import (
    OWN_GUARDS,
    Guard,
    Law,
    SiteLaw,
    fill_each,
    fill_no_signals,
    no_start,
)
from tautwave.controller.wrapping import bound, record_with
from tautwave.laws.counters import ENERGY_QUANTUM, apart
from tautwave.link.columns import DELAY, LOST, SILENCE
from tautwave.link.network import SENT, Network, forward, network_places, newest_of, start_network
from tautwave.link.news import (
    credit_said,
    effort_heard,
    effort_said,
    level_heard,
    motion_heard,
    motion_said,
)
from tautwave.link.packet import Line
from tautwave.link.post import last_line, put_line
from tautwave.link.receiver import EMPTY
from tautwave.models import network
from tautwave.models.network import NetworkParams


class NewsEndParams(NamedTuple):
    """Constants of one end.

    `network` brings packets here, drawn for this `direction`. Places in the table: `seed`; `post`
    with `days` slots that the other end sent, and what of them is under way (`link.network`);
    `last`: the last slot of those. A packet repeats no slots: `repeated` is 0. `silence` and
    `lost`: slots without a packet until the far side counts as standing, and until the run stops.
    `position`: master units of what is said to it.
    """

    network: NetworkParams
    seed: int
    direction: int
    post: int
    days: int
    last: int
    repeated: int
    silence: int
    lost: int
    position: float = 1.0


class NewsParams(NamedTuple):
    """Constants of a pair's link, in slots of `period_ns`."""

    period_ns: int
    master: NewsEndParams
    slave: NewsEndParams


@dataclass(slots=True)
class NewsEnd:
    """One end: exchanges so far, those since a packet came, the newest slot and credit heard."""

    slot: int = 0
    silent: int = 0
    heard: int = -1
    credit: int = 0
    network: Network = field(default_factory=Network)


@dataclass(slots=True)
class News:
    """Both ends; `cleared`: nothing has crossed since they were."""

    cleared: bool = False
    master: NewsEnd = field(default_factory=NewsEnd)
    slave: NewsEnd = field(default_factory=NewsEnd)


@dataclass(slots=True)
class Heard:
    """How the network stands, as recorded: age of the newest word, silence [s], packets lost."""

    delay: float = 0.0
    silence: float = 0.0
    lost: float = 0.0


PEER_LOST = OWN_GUARDS + 11
"""Code of the reason to stop."""


SIGNALS = (
    DELAY._replace(value=lambda s, p: s.end.heard.delay),
    SILENCE._replace(value=lambda s, p: s.end.heard.silence),
    LOST._replace(value=lambda s, p: s.end.heard.lost),
)
"""What is recorded of an axis beside what the law inside records."""


def no_credit(s: AxisState, p: AxisParams) -> float:
    """Return 0, the credit of a law without an account [J, pair's]."""
    return 0.0


def no_level(s: AxisState, p: AxisParams) -> float:
    """Return 1, a full tank: a law without an account has none to fill."""
    return 1.0


def no_hearing(s: AxisState, p: AxisParams, credit: float, level: float) -> None:
    """Ignore the credit: a law without an account keeps none."""


law_start = no_start
law_spring = no_spring
law_shown = where_it_is
law_fill_signals = fill_no_signals
fill_heard = fill_each(SIGNALS)
law_credit = no_credit
law_level = no_level
law_hear = no_hearing


def start_news(e: NewsEnd, k: NewsEndParams, table: MutableSequence[float]) -> None:
    """Begin with nothing under way."""
    e.slot = 0
    e.silent = 0
    e.heard = -1
    e.credit = 0
    start_network(e.network, table, k.post, k.days, int(table[k.seed]), k.direction)


def start(pair: PairView, gap: float) -> None:
    """Start the law inside; what was under way belongs to a session before."""
    c, q, table = pair.c, pair.q, pair.table
    law_start(pair, gap)
    w = c.link.news
    if not w.cleared:
        start_news(w.master, q.link.master, table)
        start_news(w.slave, q.link.slave, table)
        w.cleared = True


def say(
    far: NewsEnd,
    k: NewsEndParams,
    slot: int,
    period_ns: int,
    news: tuple[float, float, float, float, float],
    table: MutableSequence[float],
    here: bool,
) -> None:
    """Send what an end has to say to the `far` one, whose constants are `k`.

    `news`: position, velocity, effort, credit and level, in SI.
    """
    position, velocity, effort, credit, level = news
    kept = k.post + SENT * (slot % k.days)
    table[kept] = motion_said(position)
    table[kept + 1] = motion_said(velocity)
    table[kept + 2] = credit_said(credit)
    table[kept + 3] = effort_said(effort, level)
    table[k.last] = slot
    if here:
        forward(
            far.network, k.network, table, k.post, k.days,
            slot, slot * period_ns, period_ns, far.slot, period_ns,
        )  # fmt: skip


def listen(e: NewsEnd, k: NewsEndParams, table: MutableSequence[float]) -> int:
    """Take the packets of this slot; return where the newest word stands, -1 without a newer."""
    slot = newest_of(e.network, table, k.post, k.days, e.slot)
    if slot <= e.heard:
        return -1
    e.heard = slot
    e.silent = 0
    return k.post + SENT * (slot % k.days)


def see_slave(
    e: SeenEnd, q: PairParams, offset: float, table: MutableSequence[float], at: int
) -> None:
    """Turn what the slave said, at `at` in the table, into the master's units."""
    e.far_position = q.to_master * (motion_heard(int(table[at])) - offset)
    e.far_velocity = q.to_master * motion_heard(int(table[at + 1]))
    e.far_effort = q.sign * effort_heard(int(table[at + 3])) / q.force_scale


def see_master(
    e: SeenEnd, q: PairParams, offset: float, table: MutableSequence[float], at: int
) -> None:
    """Turn what the master said, at `at` in the table, into the slave's units."""
    e.far_position = q.ratio * motion_heard(int(table[at])) + offset
    e.far_velocity = q.ratio * motion_heard(int(table[at + 1]))
    e.far_effort = q.sign * q.force_scale * effort_heard(int(table[at + 3]))


def credit_heard(e: NewsEnd, counter: int) -> float:
    """Return what a counter adds to the credit that was heard of [J]; an older one nothing."""
    new = apart(counter, e.credit)
    if new <= 0:
        return 0.0
    e.credit = counter
    return new * ENERGY_QUANTUM


def pass_time(e: NewsEnd, k: NewsEndParams, s: AxisState, period: float) -> None:
    """Count a slot; let a far side that is silent stand, and stop for one that stays away."""
    h = s.end.heard
    h.delay = 0.0
    if e.heard >= 0:
        h.delay = period * (e.slot - e.heard)
    h.silence = period * e.silent
    h.lost = float(e.network.lost)
    if e.silent > k.silence:
        s.end.far_velocity = 0.0
        s.end.far_effort = 0.0
    if e.silent > k.lost and s.alarm == 0:
        s.alarm = PEER_LOST
        s.found = e.silent * period
        s.allowed = k.lost * period
    e.slot += 1
    e.silent += 1


def exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Hear and say at both ends; what leaves now arrives in the next slot at the earliest."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    k = q.link
    w = c.link.news
    w.cleared = False
    if here:
        book_spring(c, q, one, two, law_spring(q, p1, p2))
    at = listen(w.master, k.master, table)
    if at >= 0:
        see_slave(one.end, q, c.offset, table, at)
        level = level_heard(int(table[at + 3]))
        law_hear(one, p1, credit_heard(w.master, int(table[at + 2])), level)
    at = listen(w.slave, k.slave, table)
    if at >= 0:
        see_master(two.end, q, c.offset, table, at)
        level = level_heard(int(table[at + 3]))
        law_hear(two, p2, credit_heard(w.slave, int(table[at + 2])), level)
    slot = w.master.slot
    pass_time(w.master, k.master, one, q.period)
    pass_time(w.slave, k.slave, two, q.period)
    x, v = law_shown(one)
    credit = law_credit(one, p1)
    level = law_level(one, p1)
    say(w.slave, k.slave, slot, k.period_ns, (x, v, one.end.effort, credit, level), table, here)
    x, v = law_shown(two)
    credit = law_credit(two, p2)
    level = law_level(two, p2)
    say(w.master, k.master, slot, k.period_ns, (x, v, two.end.effort, credit, level), table, here)


def fill_signals(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the columns of the law inside, and how the network stands."""
    at = law_fill_signals(out, at, s, p)
    return fill_heard(out, at, s, p)


def linked_law(law: Law) -> Law:
    """Return a law made by `controller.seen` as it is over a network."""
    own = {
        "law_start": law.steps.start,
        "law_spring": law.spring,
        "law_shown": law.shown,
        "law_fill_signals": law.steps.fill_signals,
    }
    return law._replace(
        name=f"{law.name} over a network",
        steps=law.steps._replace(
            start=bound(start, own),
            exchange=bound(exchange, own),
            fill_signals=bound(fill_signals, own),
        ),
        end=record_with(law.end, "heard", Heard),
        link=record_with(law.link, "news", News),
        signals=(*law.signals, *SIGNALS),
        guards={
            **law.guards,
            PEER_LOST: Guard(
                "peer_lost",
                "lost the other side",
                "nothing was received from it for {found:.3g} s (link.lost_s: {allowed:.3g})",
            ),
        },
        rings=0,
    )


CAME, HEARD = 0, 1


def listen_at_site(e: NewsEnd, k: NewsEndParams, table: MutableSequence[float]) -> int:
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
    at = listen_at_site(w.master, k.master, table)
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
    at = listen_at_site(w.slave, k.slave, table)
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


KINDS = {
    "uniform": network.UNIFORM,
    "exponential": network.EXPONENTIAL,
    "spikes": network.SPIKES,
}
LONGEST_JITTER = 20.0
"""Of an exponential jitter, in its means: later packets are lost, two in a billion."""
FEWEST_DAYS = 64


def way_of(link: Link, trace: int, traced: int) -> network.NetworkParams:
    """Return what either direction does; `traced` pairs lie in the table from `trace` on."""
    return network.network_params(
        link.delay_s,
        jitter=link.jitter_s,
        kind=KINDS[link.jitter],
        loss=link.loss,
        burst=link.burst,
        duplicates=link.duplicate,
        reorders=link.reorder,
        outage_at=link.outage_at_s,
        outage=link.outage_s,
        outage_every=link.outage_every_s,
    )._replace(trace=trace, traced=traced)


def reach(link: Link, trace: Sequence[float]) -> float:
    """Return after how long a packet counts as lost [s]."""
    if trace:
        return 1e-9 * max(trace[1::2])
    longest = LONGEST_JITTER if link.jitter == "exponential" else 1.0
    return link.delay_s + longest * link.jitter_s


def linked(
    link: Link,
    pair: Any,
    period: float,
    velocity: float,
    seed: int,
    at: int,
    trace: Sequence[float] = (),
) -> tuple[NewsParams, list[float]]:
    """Return a pair's link: as `couplings.wave.link.linked`, without a receiver."""
    days = max(FEWEST_DAYS, math.ceil(reach(link, trace) / period) + 4)
    table: list[float] = []
    ends = []
    for direction in (0, 1):
        post = at + len(table)
        table += [EMPTY] * network_places(days)
        last = at + len(table)
        table += [EMPTY]
        own = at + len(table)
        table += [float(seed if link.seed is None else link.seed)]
        ends.append(
            NewsEndParams(
                network=way_of(link, 0, 0),
                seed=own,
                direction=direction,
                post=post,
                days=days,
                last=last,
                repeated=0,
                silence=round(link.silence_s / period),
                lost=round(link.lost_s / period),
                position=1.0 if direction else 1.0 / pair.position_scale,
            )
        )
    if trace:
        way = way_of(link, at + len(table), len(trace) // 2)
        ends = [end._replace(network=way) for end in ends]
        table += trace
    return NewsParams(round(period * 1e9), ends[0], ends[1]), table
