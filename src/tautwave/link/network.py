"""One direction of a simulated network: packets under way by the tick in which they arrive.

The table holds what was sent (a ring by slot: integral, energy, granted, asked) and a calendar: a
list of copies for each coming tick. A copy that would come later than the calendar reaches is lost.
"""

from __future__ import annotations

from collections.abc import MutableSequence
from dataclasses import dataclass

from tautwave.laws.receiver import ReceiverParams
from tautwave.link.receiver import Receiver, Sender, take_credit, take_pair
from tautwave.link.trace import replayed
from tautwave.models.network import LOST, NetworkParams, seeded, transit

SENT = 4
NONE = -1.0


@dataclass(slots=True)
class Network:
    """State of one direction: generator, burst, latest arrival, how many came and were lost."""

    one: int = 1
    two: int = 1
    losing: bool = False
    last_ns: int = 0
    arrived: int = 0
    lost: int = 0
    heard: int = -1


def network_places(size: int) -> int:
    """Return the floats that a direction needs for delays of up to `size` ticks and slots."""
    return size * (SENT + 1 + 2)


def start_network(
    n: Network, table: MutableSequence[float], at: int, size: int, seed: int, direction: int
) -> None:
    """Begin with nothing under way."""
    n.one, n.two = seeded(seed, direction)
    n.losing = False
    n.last_ns = 0
    n.arrived = 0
    n.lost = 0
    n.heard = -1
    for i in range(size):
        table[at + SENT * size + i] = NONE


def keep_sent(
    table: MutableSequence[float], at: int, size: int, s: Sender, granted: int, asked: int
) -> None:
    """Keep what the packet of the sender's last slot says."""
    kept = at + SENT * (s.slot % size)
    table[kept] = s.integral
    table[kept + 1] = s.energy
    table[kept + 2] = granted
    table[kept + 3] = asked


def post(
    n: Network,
    p: NetworkParams,
    table: MutableSequence[float],
    at: int,
    size: int,
    s: Sender,
    r: Receiver,
    now_ns: int,
    slot_ns: int,
    now: int,
    period_ns: int,
) -> None:
    """Send the packet of the sender's last slot of `slot_ns`.

    `now` is the coming tick of the receiving end, of `period_ns`.
    """
    keep_sent(table, at, size, s, r.granted, r.asked)
    forward(n, p, table, at, size, s.slot, now_ns, slot_ns, now, period_ns)


def forward(
    n: Network,
    p: NetworkParams,
    table: MutableSequence[float],
    at: int,
    size: int,
    slot: int,
    now_ns: int,
    slot_ns: int,
    now: int,
    period_ns: int,
) -> None:
    """Put the packet of a slot, which was kept, on its way: as `post`."""
    if p.traced > 0:
        arrival = replayed(table, p.trace, p.traced, now_ns)
        copy = LOST
    else:
        n.one, n.two, n.losing, n.last_ns, arrival, copy = transit(
            p, n.one, n.two, n.losing, n.last_ns, now_ns
        )
    due = -((-arrival) // period_ns)
    # A place of the ring is free again once the slot is so old; the calendar is as long.
    reach_ns = now_ns + (size - 1) * min(slot_ns, period_ns)
    if arrival == LOST or arrival > reach_ns:
        n.lost += 1
        return
    file_copy(table, at, size, slot, 0, max(due, now))
    due = -((-copy) // period_ns)
    if copy != LOST and copy <= reach_ns:
        file_copy(table, at, size, slot, 1, max(due, now))


def file_copy(
    table: MutableSequence[float], at: int, size: int, slot: int, copy: int, due: int
) -> None:
    """Put a copy of a slot's packet on the list of the tick in which it arrives."""
    day = at + SENT * size + due % size
    node = 2 * (slot % size) + copy
    table[at + (SENT + 1) * size + node] = table[day]
    table[day] = 2 * slot + copy


def take_copy(table: MutableSequence[float], at: int, size: int, now: int) -> int:
    """Take a copy off the list of a tick and return its slot, -1 where none is left."""
    day = at + SENT * size + now % size
    copy = int(table[day])
    if copy < 0:
        return -1
    table[day] = table[at + (SENT + 1) * size + 2 * (copy // 2 % size) + copy % 2]
    return copy // 2


def newest_of(n: Network, table: MutableSequence[float], at: int, size: int, now: int) -> int:
    """Take all packets of a tick; return the newest slot among them, -1 where none came."""
    newest = -1
    slot = take_copy(table, at, size, now)
    while slot >= 0:
        n.arrived += 1
        if slot > newest:
            newest = slot
        slot = take_copy(table, at, size, now)
    return newest


def deliver(
    n: Network,
    table: MutableSequence[float],
    at: int,
    size: int,
    now: int,
    r: Receiver,
    p: ReceiverParams,
    rings: MutableSequence[float],
    ring: int,
    places: int,
    repeated: int,
) -> None:
    """Hand the receiver all packets of a tick, each with `repeated` slots before its own."""
    slot = take_copy(table, at, size, now)
    while slot >= 0:
        n.arrived += 1
        for back in range(min(repeated, slot) + 1):
            kept = at + SENT * ((slot - back) % size)
            take_pair(
                r, p, rings, ring, places, slot - back, int(table[kept]), int(table[kept + 1])
            )
        if slot > n.heard:
            n.heard = slot
            kept = at + SENT * (slot % size)
            take_credit(r, int(table[kept + 2]), int(table[kept + 3]))
        slot = take_copy(table, at, size, now)
