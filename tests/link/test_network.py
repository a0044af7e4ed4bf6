"""Packets under way: each comes in its tick, with what it repeats, once for each copy."""

from __future__ import annotations

import heapq

import pytest

from tautwave.laws.receiver import receiver_params
from tautwave.link.network import (
    Network,
    deliver,
    network_places,
    post,
    start_network,
    take_copy,
)
from tautwave.link.receiver import PLACE, Receiver, Sender, ring_size, send, start_receiver
from tautwave.models.network import LOST, NetworkParams, network_params, seeded, transit

DAYS = 64
TICK_NS = 1_000_000


def due_slots(p: NetworkParams, slot_ns: int, count: int, seed: int) -> list[list[int]]:
    """Return the slots that arrive in each tick, by a heap instead of a calendar."""
    one, two = seeded(seed, 0)
    losing, last = False, 0
    heap: list[tuple[int, int]] = []
    for slot in range(count):
        now = slot * slot_ns
        one, two, losing, last, came, copy = transit(p, one, two, losing, last, now)
        for arrival in (came, copy):
            if arrival != LOST and arrival <= now + (DAYS - 1) * min(slot_ns, TICK_NS):
                heapq.heappush(heap, (-(-arrival // TICK_NS), slot))
    ticks: list[list[int]] = [[] for _ in range(count * slot_ns // TICK_NS + DAYS + 1)]
    for due, slot in heap:
        ticks[due].append(slot)
    return ticks


@pytest.mark.parametrize("slot_ns", [TICK_NS, TICK_NS // 4, 4 * TICK_NS])
@pytest.mark.parametrize("jitter", [0.0, 0.004, 0.2])
def test_the_calendar_has_each_copy_in_its_tick(slot_ns: int, jitter: float) -> None:
    way = network_params(0.002, jitter=jitter, loss=0.1, duplicates=0.3)
    table = [0.0] * network_places(DAYS)
    n, s = Network(), Sender()
    start_network(n, table, 0, DAYS, 9, 0)
    expected = due_slots(way, slot_ns, 600, 9)
    for tick in range(600 * slot_ns // TICK_NS):
        while (s.slot + 1) * slot_ns <= tick * TICK_NS:
            send(s, 1e-3, 1.0)
            at_ns = s.slot * slot_ns
            post(n, way, table, 0, DAYS, s, Receiver(), at_ns, slot_ns, tick, TICK_NS)
        found = []
        while (slot := take_copy(table, 0, DAYS, tick)) >= 0:
            found.append(slot)
        assert sorted(found) == sorted(expected[tick])


def test_a_packet_brings_what_it_repeats_and_the_newest_word_on_credit() -> None:
    p = receiver_params(1e-3, sender_period=1e-3, depth=0.01)
    places = ring_size(p)
    ring, table = [0.0] * (PLACE * places), [0.0] * network_places(DAYS)
    way = network_params(0.003, outage_at=0.0015, outage=0.001)  # slot 2 is lost
    n, s, r, far = Network(), Sender(), Receiver(), Receiver()
    start_receiver(r, ring, 0, places)
    start_network(n, table, 0, DAYS, 0, 0)
    known = []
    for tick in range(8):
        far.granted, far.asked = 10 * tick, 100 * tick
        send(s, 1e-3, float(tick))
        post(n, way, table, 0, DAYS, s, far, tick * TICK_NS, TICK_NS, tick, TICK_NS)
        deliver(n, table, 0, DAYS, tick, r, p, ring, 0, places, 1)
        known.append(sorted(int(slot) for slot in ring[::PLACE] if slot >= 0))
    assert known[3:] == [[0], [0, 1], [0, 1], [0, 1, 2, 3], [0, 1, 2, 3, 4]]
    assert (r.was_granted, r.was_asked, n.lost, n.arrived) == (40, 400, 1, 4)


def test_an_overtaken_packet_does_not_bring_old_credit_back() -> None:
    p = receiver_params(1e-3, sender_period=1e-3, depth=0.01)
    places = ring_size(p)
    ring, table = [0.0] * (PLACE * places), [0.0] * network_places(DAYS)
    n, s, r, far = Network(), Sender(), Receiver(), Receiver()
    start_receiver(r, ring, 0, places)
    start_network(n, table, 0, DAYS, 0, 0)
    for tick, delay in enumerate((0.006, 0.001)):
        far.granted, far.asked = 10 + tick, 100 + tick
        send(s, 1e-3, 1.0)
        way = network_params(delay)
        post(n, way, table, 0, DAYS, s, far, tick * TICK_NS, TICK_NS, tick, TICK_NS)
    for tick in range(8):
        deliver(n, table, 0, DAYS, tick, r, p, ring, 0, places, 0)
        if tick >= 2:
            assert (r.was_granted, r.was_asked) == (11, 101)
    assert n.arrived == 2


def test_a_packet_that_is_posted_late_comes_at_once() -> None:
    n, s, table = Network(), Sender(), [0.0] * network_places(DAYS)
    start_network(n, table, 0, DAYS, 0, 0)
    send(s, 1e-3, 1.0)
    way = network_params(0.0, duplicates=1.0)
    post(n, way, table, 0, DAYS, s, Receiver(), 0, TICK_NS, 5, TICK_NS)
    assert [take_copy(table, 0, DAYS, 5) for _ in range(3)] == [0, 0, -1]
