"""A simulated network loses, delays and repeats as often as it says; the same for each seed."""

from __future__ import annotations

import math
from itertools import groupby

import pytest

from tautwave.models.network import (
    EXPONENTIAL,
    LOST,
    SPIKES,
    UNIFORM,
    NetworkParams,
    draw,
    is_down,
    network_params,
    seeded,
    transit,
)

SLOT_NS = 1_000_000
DELAY_NS = 10_000_000


def packets(p: NetworkParams, count: int = 20_000, seed: int = 1) -> list[tuple[int, int]]:
    """Return delay of each packet, and of its duplicate [ns]."""
    one, two = seeded(seed, 0)
    losing, last, found = False, 0, []
    for k in range(count):
        now = k * SLOT_NS
        one, two, losing, last, came, copy = transit(p, one, two, losing, last, now)
        found.append((came - now if came != LOST else LOST, copy - now if copy != LOST else LOST))
    return found


def test_the_generator_is_the_published_one() -> None:
    """A second implementation, of the formula in the paper, in its order of operations."""
    one, two = 12345, 67890
    s1, s2 = one, two
    for _ in range(100):
        one, two, number = draw(one, two)
        k = s1 // 53668
        s1 = 40014 * (s1 - k * 53668) - k * 12211
        s1 += 2147483563 if s1 < 0 else 0
        k = s2 // 52774
        s2 = 40692 * (s2 - k * 52774) - k * 3791
        s2 += 2147483399 if s2 < 0 else 0
        z = s1 - s2
        z += 2147483562 if z < 1 else 0
        assert (one, two) == (s1, s2)
        assert number == pytest.approx(z * 4.656613e-10, rel=1e-6)


def test_numbers_are_even_and_seeds_unlike() -> None:
    one, two = seeded(3, 0)
    numbers = []
    for _ in range(20_000):
        one, two, number = draw(one, two)
        numbers.append(number)
    assert sum(numbers) / 20_000 == pytest.approx(0.5, abs=0.01)
    assert sum(n < 0.1 for n in numbers) / 20_000 == pytest.approx(0.1, abs=0.01)
    assert len({seeded(s, d) for s in range(1000) for d in (0, 1)}) == 2000


def test_without_impairments_each_packet_takes_the_delay() -> None:
    assert set(packets(network_params(0.01), 500)) == {(DELAY_NS, LOST)}


@pytest.mark.parametrize(("loss", "burst"), [(0.02, 1.0), (0.1, 5.0), (0.5, 20.0)])
def test_losses_have_their_share_and_come_in_bursts(loss: float, burst: float) -> None:
    lost = [came == LOST for came, _ in packets(network_params(0.01, loss=loss, burst=burst))]
    runs = [len(list(group)) for gone, group in groupby(lost) if gone]
    assert sum(lost) / len(lost) == pytest.approx(loss, rel=0.25)
    assert sum(runs) / len(runs) == pytest.approx(burst if burst > 1 else 1.0, rel=0.25)


@pytest.mark.parametrize(
    ("kind", "mean", "most"),
    [(UNIFORM, 0.5, 1.0), (EXPONENTIAL, 1.0, math.inf), (SPIKES, 0.02, 1.0)],
)
def test_jitter_has_its_distribution(kind: int, mean: float, most: float) -> None:
    late = [came - DELAY_NS for came, _ in packets(network_params(0.01, jitter=0.005, kind=kind))]
    assert sum(late) / len(late) / 5e6 == pytest.approx(mean, rel=0.1)
    assert min(late) >= 0
    assert max(late) <= most * 5e6
    if kind == SPIKES:
        assert set(late) == {0, 5_000_000}


def test_packets_overtake_only_where_they_may() -> None:
    for reorders in (True, False):
        way = network_params(0.01, jitter=0.005, reorders=reorders)
        came = [delay + k * SLOT_NS for k, (delay, _) in enumerate(packets(way, 2000))]
        assert (came != sorted(came)) is reorders


def test_duplicates_come_later_than_what_they_repeat() -> None:
    found = packets(network_params(0.01, jitter=0.005, duplicates=0.2))
    copies = [(first, second) for first, second in found if second != LOST]
    assert len(copies) / len(found) == pytest.approx(0.2, rel=0.1)
    assert all(second >= first for first, second in copies)


def test_an_outage_loses_all_while_it_lasts_and_shifts_no_other_packet() -> None:
    way = network_params(0.01, jitter=0.005, loss=0.1)
    down = network_params(0.01, jitter=0.005, loss=0.1, outage_at=0.3, outage=0.2, outage_every=1)
    for k, (one, two) in enumerate(zip(packets(way, 3000), packets(down, 3000), strict=True)):
        if 300 <= k % 1000 < 500:
            assert two == (LOST, LOST)
        else:
            assert one == two
    once = network_params(0.0, outage_at=2.0, outage=1.0)
    assert [is_down(once, at * 10**9) for at in range(4)] == [False, False, True, False]
