"""Law wave over a network: the steps of a pair, its constants from keys, and one end at a site.

In every slot each end takes what came, counts the wave that leaves, and plays out the wave that
arrives; what leaves now arrives in the next slot at the earliest, as between two loops. With no
packet for `silence` slots an end holds: no wave comes out, and its port is a damper of the line's
impedance. Backlog waits, and is repaid later at a bounded speed.

At one of two sites only its own end runs; packets come from and go to a real network.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.columns import Column
from tautwave.config.keys.common import AUTO
from tautwave.config.keys.link import Link
from tautwave.contracts import Row
from tautwave.controller.records import NEVER, AxisParams, AxisState, PairParams, PairView
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import OWN_GUARDS, Guard, SiteLaw, fill_each
from tautwave.couplings.over_link import FEWEST_DAYS, reach, way_of
from tautwave.couplings.wave.keys import WavePair
from tautwave.couplings.wave.law import arrive_rated, fill_converter, fill_tank, leave_rated
from tautwave.couplings.wave.law import element_names as line_names
from tautwave.couplings.wave.law import law as line_law
from tautwave.couplings.wave.law import start as line_start
from tautwave.couplings.wave.port import (
    PORT_OVERDRAWN,
    PORT_STARVED,
    POSITION_DEBT,
    WaveEnd,
    receive_wave,
    repeat_wave,
)
from tautwave.laws.counters import ENERGY_QUANTUM, WAVE_QUANTUM, added, apart
from tautwave.laws.receiver import ReceiverParams, receiver_params
from tautwave.link.columns import DELAY, LOST, SILENCE
from tautwave.link.network import Network, deliver, keep_sent, network_places, post, start_network
from tautwave.link.packet import Line
from tautwave.link.post import last_line
from tautwave.link.receiver import (
    EMPTY,
    PLACE,
    Receiver,
    Sender,
    ring_size,
    send,
    start_receiver,
    start_sender,
    take_credit,
    take_pair,
    tick,
)
from tautwave.models.network import NetworkParams


class LinkEndParams(NamedTuple):
    """Constants of one end of a link.

    `network` brings packets here, drawn for this `direction`. Places in the table: `seed`; `ring`
    with `places` slots received; `post` with `days` slots that the other end sent, and what of them
    is under way (`link.network`); `last`: the last slot of those. A packet repeats `repeated`
    slots. `silence` and `lost`: slots without a packet until the end holds, and stops; `position`:
    master's rad or m per quantum of the wave integral.
    """

    receiver: ReceiverParams
    network: NetworkParams
    seed: int
    direction: int
    ring: int
    places: int
    post: int
    days: int
    last: int
    repeated: int
    silence: int
    lost: int
    position: float


class LinkParams(NamedTuple):
    """Constants of a pair's link, in slots of `period_ns`."""

    period_ns: int
    master: LinkEndParams
    slave: LinkEndParams


@dataclass(slots=True)
class LinkEnd:
    """State of one end of a link, and its books.

    `slot` counts exchanges, `silent` those since a packet came. `heard` is the newest energy
    counter that came, `credited` the newest credit. Books [J]: `left` and, as credit, `returned`
    entered the network here, `taken` came out of it, `given` went into the port. `afloat` is what
    entered the network here less what came out of it, in whole energy quanta: its sum over both
    ends is under way. `cut` counts ticks on which energy was short.
    """

    slot: int = 0
    silent: int = 0
    heard: int = 0
    credited: int = 0
    afloat: int = 0
    cut: int = 0
    left: float = 0.0
    returned: float = 0.0
    taken: float = 0.0
    given: float = 0.0
    sender: Sender = field(default_factory=Sender)
    receiver: Receiver = field(default_factory=Receiver)
    network: Network = field(default_factory=Network)


@dataclass(slots=True)
class LinkPair:
    """State of a pair's link; `used`: something has crossed since its tables were cleared."""

    used: bool = False
    master: LinkEnd = field(default_factory=LinkEnd)
    slave: LinkEnd = field(default_factory=LinkEnd)


@dataclass(slots=True)
class LinkedEnd(WaveEnd):
    """State of a port behind a receiver, and how that stands: its columns.

    `delay` [s] of the wave played out, `depth` [s] of it waiting for that, `backlog` [rad or m,
    master] that is owed, `silence` [s] since a packet came, packets `lost`, ticks `cut` for want of
    energy.
    """

    delay: float = 0.0
    depth: float = 0.0
    backlog: float = 0.0
    silence: float = 0.0
    lost: float = 0.0
    cut: float = 0.0


RECEIVER_OVERDRAWN = OWN_GUARDS + 10
PEER_LOST = OWN_GUARDS + 11
"""Codes of the reasons to stop."""


def start_link_end(e: LinkEnd, k: LinkEndParams, table: MutableSequence[float]) -> None:
    """Begin a session at one end: nothing is stored, nothing under way."""
    e.slot = 0
    e.silent = 0
    e.heard = 0
    e.credited = 0
    e.afloat = 0
    e.cut = 0
    e.left = 0.0
    e.returned = 0.0
    e.taken = 0.0
    e.given = 0.0
    start_sender(e.sender)
    start_receiver(e.receiver, table, k.ring, k.places)
    start_network(e.network, table, k.post, k.days, int(table[k.seed]), k.direction)


def start(pair: PairView, gap: float) -> None:
    """Begin a session; the slave's port mends the `gap` [rad or m]."""
    c, q, table = pair.c, pair.q, pair.table
    w = c.link
    line_start(pair, gap)
    if not w.used:
        start_link_end(w.master, q.link.master, table)
        start_link_end(w.slave, q.link.slave, table)
        w.used = True


def pass_end(
    e: LinkEnd,
    k: LinkEndParams,
    s: AxisState,
    p: AxisParams,
    q: PairParams,
    here: bool,
    due: bool,
    table: MutableSequence[float],
) -> None:
    """Pass one slot at one end, after the packets that came have been taken.

    The other end, its axis and its constants are not looked at.
    """
    period = q.period
    half = 0.5 * period
    if q.rated:
        wave = leave_rated(s, p, due, here)
    elif here:
        wave = s.end.leaving
    else:
        wave = repeat_wave(s, p)
    before = e.sender.energy
    send(e.sender, period, wave)
    e.left += half * wave * wave
    r = e.receiver
    granted = r.granted
    arriving = 0.0
    r.short = False
    if e.silent <= k.silence:
        arriving = tick(r, k.receiver, table, k.ring, k.places)
        e.given += half * arriving * arriving
    if r.short:
        e.cut += 1
    returned = apart(r.granted, granted)
    e.afloat += apart(e.sender.energy, before) + returned
    e.returned += returned * ENERGY_QUANTUM
    e.slot += 1
    e.silent += 1
    tell(e, k, s, period)
    guard(e, k, s, period)
    if q.rated:
        arrive_rated(s, p, arriving, due)
    else:
        receive_wave(s, p, arriving)


def tell(e: LinkEnd, k: LinkEndParams, s: AxisState, period: float) -> None:
    """Put down how a receiver stands."""
    r = e.receiver
    t = s.end
    t.delay = 0.0
    t.depth = 0.0
    if r.begun:
        t.delay = period * (e.slot - 1 - r.pointer)
        t.depth = period * (r.newest - r.pointer)
    t.backlog = k.position * apart(r.played, r.given)
    t.silence = period * (e.silent - 1)
    t.lost = float(e.network.lost)
    t.cut = float(e.cut)


def guard(e: LinkEnd, k: LinkEndParams, s: AxisState, period: float) -> None:
    """Compare in whole quanta what went into the port with what came; look whether any does."""
    r = e.receiver
    short = apart(added(e.heard, r.was_granted), r.spent) + k.receiver.reserve
    if short < 0:
        s.alarm = RECEIVER_OVERDRAWN
        s.found = (k.receiver.reserve - short) * ENERGY_QUANTUM
        s.allowed = k.receiver.reserve * ENERGY_QUANTUM
    elif e.silent > k.lost and s.alarm == 0:
        s.alarm = PEER_LOST
        s.found = e.silent * period
        s.allowed = k.lost * period


def take_note(e: LinkEnd, k: LinkEndParams, before: int, table: MutableSequence[float]) -> None:
    """Book what the packets of this slot brought; `before`: the newest slot until then."""
    r = e.receiver
    came = apart(r.was_granted, e.credited)
    e.credited = r.was_granted
    if r.newest > before:
        e.silent = 0
        newest = int(table[k.ring + PLACE * (r.newest % k.places) + 2])
        came += apart(newest, e.heard)
        e.heard = newest
    e.taken += came * ENERGY_QUANTUM
    e.afloat -= came


def collect(e: LinkEnd, k: LinkEndParams, table: MutableSequence[float]) -> None:
    """Take the packets of the simulated network that arrive in this slot."""
    before = e.receiver.newest
    deliver(
        e.network, table, k.post, k.days, e.slot, e.receiver, k.receiver, table, k.ring, k.places,
        k.repeated,
    )  # fmt: skip
    take_note(e, k, before, table)


def dispatch(
    e: LinkEnd,
    far: LinkEnd,
    k: LinkEndParams,
    period_ns: int,
    here: bool,
    table: MutableSequence[float],
) -> None:
    """Send what this end has to say to the `far` one, whose constants are `k`.

    A slot that the loop did not see sends nothing; the next packet speaks for it.
    """
    table[k.last] = e.sender.slot
    if here:
        post(
            far.network, k.network, table, k.post, k.days, e.sender, e.receiver,
            e.sender.slot * period_ns, period_ns, far.slot, period_ns,
        )  # fmt: skip
    else:
        keep_sent(table, k.post, k.days, e.sender, e.receiver.granted, e.receiver.asked)


def exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Pass one slot at both ends."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    k = q.link
    master = c.link.master
    slave = c.link.slave
    collect(master, k.master, table)
    collect(slave, k.slave, table)
    pass_end(master, k.master, one, p1, q, here, due_one, table)
    pass_end(slave, k.slave, two, p2, q, here, due_two, table)
    dispatch(master, slave, k.slave, k.period_ns, here, table)
    dispatch(slave, master, k.master, k.period_ns, here, table)
    if master.afloat + slave.afloat < 0:
        one.alarm = RECEIVER_OVERDRAWN
        one.found = -(master.afloat + slave.afloat) * ENERGY_QUANTUM
        one.allowed = 0.0


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the names of a pair's elements in the order of their columns."""
    return [*line_names(q, p1, p2), "receiver_master", "receiver_slave", "network"]


SIGNALS = (
    *line_law.signals,
    DELAY._replace(value=lambda s, p: s.end.delay),
    Column(
        "link_depth",
        "s",
        "over a network: how much of that was waiting here",
        lambda s, p: s.end.depth,
    ),
    Column(
        "link_backlog",
        "rad, m",
        "over a network: motion of the other side still outstanding, in the master's units",
        lambda s, p: s.end.backlog,
    ),
    SILENCE._replace(value=lambda s, p: s.end.silence),
    LOST._replace(value=lambda s, p: s.end.lost),
    Column(
        "link_cut",
        "",
        "over a network: cycles so far in which the energy received did not cover the wave",
        lambda s, p: s.end.cut,
    ),
)
"""What is recorded of an axis."""

ACCOUNTS = {
    **line_law.accounts,
    "receiver_SIDE": "energy sent to a side and not yet released, in counts of 2^-40 J",
    "network": "energy in transit",
}
"""What the elements of a pair are."""


def fill_receiver(out: Row, at: int, e: LinkEnd) -> int:
    """Write the account of a receiver: what it holds is a difference of counters."""
    r = e.receiver
    stored = ENERGY_QUANTUM * apart(added(e.heard, r.was_granted), r.spent)
    return fill_element(out, at, e.taken - e.given - e.returned, stored, r.dropped)


def fill_elements(out: Row, at: int, pair: PairView) -> int:
    """Write the accounts of ports, converters, receivers and network."""
    c, one, two, p1, p2, table = pair.c, pair.one, pair.two, pair.p1, pair.p2, pair.table
    w = c.link
    at = fill_tank(out, at, one, p1, table)
    at = fill_tank(out, at, two, p2, table)
    at = fill_converter(out, at, one, p1)
    at = fill_converter(out, at, two, p2)
    at = fill_receiver(out, at, w.master)
    at = fill_receiver(out, at, w.slave)
    entered = w.master.left + w.master.returned + w.slave.left + w.slave.returned
    entered = entered - w.master.taken - w.slave.taken
    afloat = ENERGY_QUANTUM * (w.master.afloat + w.slave.afloat)
    return fill_element(out, at, entered, afloat, 0.0)


law = line_law._replace(
    steps=line_law.steps._replace(
        start=start,
        exchange=exchange,
        fill_signals=fill_each(SIGNALS),
        fill_elements=fill_elements,
    ),
    end=LinkedEnd,
    link=LinkPair,
    signals=SIGNALS,
    elements=element_names,
    accounts=ACCOUNTS,
    guards={
        **line_law.guards,
        RECEIVER_OVERDRAWN: Guard(
            "receiver_overdrawn",
            "got more energy from its receiver than was sent to it",
            "{found:.3g} J more (limit {allowed:.3g} J)",
        ),
        PEER_LOST: Guard(
            "peer_lost",
            "lost the other side",
            "nothing was received from it for {found:.3g} s (link.lost_s: {allowed:.3g})",
        ),
    },
    rings=0,
)


CATCH_UP = 0.25
"""Share of the lower velocity limit at which a backlog is repaid at most."""


class Linked(NamedTuple):
    """A pair's link as constants, and the part of the table that it begins with."""

    params: LinkParams
    table: list[float]


def receiver_of(link: Link, pair: WavePair, period: float, velocity: float) -> ReceiverParams:
    """Return the constants of both receivers; `velocity`: lower limit [rad/s or m/s, master]."""
    depth = 0.0 if link.depth_s == AUTO else float(link.depth_s)
    return receiver_params(
        period,
        sender_period=period,
        depth=depth,
        deepest=link.deepest_s if link.depth_s == AUTO else depth,
        newest=link.play_out == "newest",
        fastest=math.sqrt(2.0 * pair.impedance) * CATCH_UP * velocity,
    )


def linked(
    link: Link,
    pair: WavePair,
    period: float,
    velocity: float,
    seed: int,
    at: int,
    trace: Sequence[float] = (),
) -> Linked:
    """Return a pair's link.

    Parameters
    ----------
    link, pair : Link, WavePair
        Their keys, with numbers for `auto`.
    period : float
        Of a slot [s].
    velocity : float
        The lower velocity limit of both devices [rad/s or m/s, master].
    seed : int
        Of the rig, unless the link has its own.
    at : int
        Where its part of the table begins.
    trace : sequence of float
        The recorded network (`link.trace`), if there is one.
    """
    receiver = receiver_of(link, pair, period, velocity)
    places = max(ring_size(receiver), link.repeated + 2)
    days = max(FEWEST_DAYS, math.ceil(reach(link, trace) / period) + 2 * link.repeated + 4)
    table: list[float] = []
    ends = []
    for direction in (0, 1):
        ring = at + len(table)
        table += [EMPTY] * (PLACE * places)
        post = at + len(table)
        table += [EMPTY] * network_places(days)
        last = at + len(table)
        table += [EMPTY]
        own = at + len(table)
        table += [float(seed if link.seed is None else link.seed)]
        ends.append(
            LinkEndParams(
                receiver=receiver,
                network=way_of(link, 0, 0),
                seed=own,
                direction=direction,
                ring=ring,
                places=places,
                post=post,
                days=days,
                last=last,
                repeated=link.repeated,
                silence=round(link.silence_s / period),
                lost=round(link.lost_s / period),
                position=WAVE_QUANTUM / math.sqrt(2.0 * pair.impedance),
            )
        )
    if trace:
        way = way_of(link, at + len(table), len(trace) // 2)
        ends = [end._replace(network=way) for end in ends]
        table += trace
    params = LinkParams(round(period * 1e9), ends[0], ends[1])
    return Linked(params, table)


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


DEBTS = frozenset((PORT_OVERDRAWN, PORT_STARVED, POSITION_DEBT))
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
