"""Two devices on wave ports with a network between; each end on a clock and a rate of its own.

Written in the subset that plain Python and numba share. Ports, receivers and network are the
product's; devices are a mass with friction between a hand and a wall. Ends take turns by the time
of their next tick, in whole nanoseconds.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from tautwave.laws.counters import ENERGY_QUANTUM, added, apart
from tautwave.laws.limit import clamp
from tautwave.laws.observer import ObserverParams, observe
from tautwave.laws.port import PortParams, port_close, port_effort
from tautwave.laws.receiver import ReceiverParams
from tautwave.link.network import Network, deliver, post, start_network
from tautwave.link.receiver import (
    Receiver,
    Sender,
    funds_of,
    send,
    start_receiver,
    start_sender,
    tick,
)
from tautwave.models.network import NetworkParams
from tests.lab.lines.rejected import Rejected, play_rejected

PLAY_OUT = 0
NULL = 1
BUFFER = 2
HOLD = 3
"""Receivers: the law; and those that do not do: see `rejected`."""

SUBSTEPS = 4


class EndParams(NamedTuple):
    """Constants of one end, SI.

    `network` brings packets here; `ring`, `places`, `calendar`, `days` say where its receiver and
    its network lie in the table; `repeated`: slots that a packet repeats; `policy`: which receiver.
    """

    port: PortParams
    observer: ObserverParams
    receiver: ReceiverParams
    network: NetworkParams
    period_ns: int
    mass: float
    damping: float
    coulomb: float
    hand: float
    hand_damping: float
    wall: float
    wall_at: float
    noise: float
    quantum: float
    most: float
    ring: int
    places: int
    calendar: int
    days: int
    repeated: int
    policy: int
    seed: int


@dataclass(slots=True)
class End:
    """State of one end, its books [J], and what is looked at.

    `sent_energy` and `got_energy` are of the waves; `excess` is the most by which more came out of
    this receiver than the other end had sent; `violations` ticks on which the integers said so.
    """

    x: float = 0.0
    v: float = 0.0
    sample: float = 0.0
    at: float = 0.0
    velocity: float = 0.0
    outside: float = 0.0
    account: float = 0.0
    gap: float = 0.0
    filtered: float = 0.0
    effort: float = 0.0
    arriving: float = 0.0
    given: float = 0.0
    sent_energy: float = 0.0
    got_energy: float = 0.0
    excess: float = 0.0
    ticks: int = 0
    violations: int = 0
    cut: bool = False
    sender: Sender = field(default_factory=Sender)
    receiver: Receiver = field(default_factory=Receiver)
    network: Network = field(default_factory=Network)
    rejected: Rejected = field(default_factory=Rejected)


def start_end(e: End, p: EndParams, table: MutableSequence[float], direction: int) -> None:
    """Begin at rest with a full tank and nothing under way."""
    e.account = p.port.reserve
    e.rejected.newest = -1
    start_sender(e.sender)
    start_receiver(e.receiver, table, p.ring, p.places)
    start_network(e.network, table, p.calendar, p.days, p.seed, direction)


def move_device(e: End, p: EndParams, reference: float) -> None:
    """Let a period pass under the effort that is held."""
    span = p.port.period / SUBSTEPS
    for _ in range(SUBSTEPS):
        force = -e.effort - p.damping * e.v
        if p.hand > 0.0:
            force += p.hand * (reference - e.x) - p.hand_damping * e.v
        if p.wall > 0.0 and e.x > p.wall_at:
            force -= p.wall * (e.x - p.wall_at)
        e.v += span / p.mass * force
        if p.coulomb > 0.0:
            e.v -= clamp(e.v, p.coulomb * span / p.mass)
        before = e.x
        e.x += span * e.v
        e.given -= e.effort * (e.x - before)


def leave_wave(e: End, p: EndParams, noise: float) -> float:
    """Measure, observe, close the port's account; return the wave that leaves [W**0.5]."""
    sample = e.x + p.noise * noise
    if p.quantum > 0.0:
        sample = p.quantum * math.floor(sample / p.quantum + 0.5)
    at, velocity, outside = observe(p.observer, e.at, e.velocity, e.outside, sample, e.effort, 1.0)
    energy = 0.5 * p.port.period * e.arriving * e.arriving
    leaving, account, gap, filtered, _, _, _ = port_close(
        p.port, e.account, e.gap, e.filtered, sample - e.sample, at - e.at, 1.0, e.effort,
        e.arriving, energy, e.cut,
    )  # fmt: skip
    e.sample = sample
    e.at = at
    e.velocity = velocity
    e.outside = outside
    e.account = account
    e.gap = gap
    e.filtered = filtered
    return leaving


def run_end(
    e: End,
    p: EndParams,
    far: End,
    q: EndParams,
    table: MutableSequence[float],
    reference: float,
    noise: float,
) -> None:
    """Run one tick of an end whose peer is `far`."""
    now_ns = e.ticks * p.period_ns
    move_device(e, p, reference)
    leaving = leave_wave(e, p, noise)
    send(e.sender, p.port.period, leaving)
    e.sent_energy += 0.5 * p.port.period * leaving * leaving
    post(
        far.network, q.network, table, q.calendar, q.days, e.sender, e.receiver, now_ns,
        p.period_ns, far.ticks, q.period_ns,
    )  # fmt: skip
    if p.policy == PLAY_OUT:
        deliver(
            e.network, table, p.calendar, p.days, e.ticks, e.receiver, p.receiver, table, p.ring,
            p.places, p.repeated,
        )  # fmt: skip
        arriving = tick(e.receiver, p.receiver, table, p.ring, p.places)
    else:
        arriving = play_rejected(
            e.rejected, p.policy, p.receiver, table, p.ring, p.places, p.calendar, p.days,
            e.ticks, q.port.period,
        )  # fmt: skip
    e.got_energy += 0.5 * p.port.period * arriving * arriving
    check_energy(e, p, far)
    effort = port_effort(p.port, e.account, e.velocity, e.outside, 0.0, arriving)
    e.effort = clamp(effort, p.most)
    e.cut = e.effort != effort
    e.arriving = arriving
    e.ticks += 1


def check_energy(e: End, p: EndParams, far: End) -> None:
    """Compare what came out with what was sent: in integers, and once more in floats."""
    credit = 0.0
    if p.policy == PLAY_OUT:
        credit = far.receiver.granted * ENERGY_QUANTUM
        came = added(far.sender.energy, far.receiver.granted)
        if apart(came, e.receiver.spent) + p.receiver.reserve < 0:
            e.violations += 1
        if funds_of(e.receiver, p.receiver) < 0:
            e.violations += 1
    excess = e.got_energy - far.sent_energy - credit
    if excess > e.excess:
        e.excess = excess


def run_pair(
    params: Sequence[EndParams],
    ends: Sequence[End],
    table: MutableSequence[float],
    reference: Sequence[float],
    reference_ns: int,
    noise: Sequence[float],
    until_ns: int,
    out: MutableSequence[float],
) -> int:
    """Run both ends until a time [ns]; return the rows in `out`, one for each tick of the master.

    A row: both positions [rad], both efforts [N m], energy given by both ports together [J].
    """
    one, two = ends[0], ends[1]
    p, q = params[0], params[1]
    start_end(one, p, table, 0)
    start_end(two, q, table, 1)
    drawn = 0
    rows = 0
    while True:
        master_ns = one.ticks * p.period_ns
        slave_ns = two.ticks * q.period_ns
        if master_ns >= until_ns and slave_ns >= until_ns:
            return rows
        pull = noise[drawn % len(noise)]
        drawn += 1
        if master_ns <= slave_ns:
            hand = reference[min(master_ns // reference_ns, len(reference) - 1)]
            run_end(one, p, two, q, table, hand, pull)
            at = 5 * rows
            out[at] = one.x
            out[at + 1] = two.x
            out[at + 2] = one.effort
            out[at + 3] = two.effort
            out[at + 4] = one.given + two.given
            rows += 1
        else:
            run_end(two, q, one, p, table, 0.0, pull)
