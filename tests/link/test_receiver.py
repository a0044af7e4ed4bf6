"""The receiver: no energy from any pattern, no position lost, and in time nothing is changed."""

from __future__ import annotations

import math
import random
from dataclasses import asdict, fields
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.counters import ENERGY_QUANTUM, SPAN, WAVE_QUANTUM
from tautwave.laws.receiver import (
    LOWEST,
    ReceiverParams,
    advance,
    output_wave,
    receiver_params,
    timely_wave,
    wanted_wave,
    watched,
)
from tautwave.link.receiver import (
    PLACE,
    Receiver,
    Sender,
    funds_of,
    play_to,
    ring_size,
    settle,
    start_receiver,
    start_sender,
    take_credit,
    take_pair,
)
from tautwave.models.network import EXPONENTIAL, SPIKES, UNIFORM, network_params
from tests.link.lines import Run, run_line

PERIOD = 0.5e-3
RATES = [(PERIOD, PERIOD), (2e-3, PERIOD), (PERIOD, 2e-3)]
DEPTH_S = 0.01


def waves_of(seed: int, count: int = 1500, noise: float = 0.3) -> list[float]:
    rng = random.Random(seed)
    return [math.sin(0.005 * k) + noise * rng.gauss(0.0, 1.0) for k in range(count)]


def equal_rates(**changes: float) -> ReceiverParams:
    return receiver_params(PERIOD, sender_period=PERIOD, **({"depth": DEPTH_S} | changes))


def joules(waves: list[float], period: float) -> float:
    return 0.5 * period * math.fsum(wave * wave for wave in waves)


shares = st.floats(0.0, 0.5)
patterns = st.fixed_dictionaries(
    {
        "jitter": st.floats(0.0, 0.05),
        "kind": st.sampled_from([UNIFORM, EXPONENTIAL, SPIKES]),
        "loss": shares,
        "burst": st.floats(1.0, 20.0),
        "duplicates": shares,
        "reorders": st.booleans(),
        "outage_at": st.floats(0.0, 0.3),
        "outage": st.floats(0.0, 0.3),
    }
)


@given(
    patterns, st.floats(0.0, 0.1), st.sampled_from(RATES), st.booleans(), st.integers(0, 7),
    st.integers(0, 1000), st.floats(-200e-6, 200e-6), st.sampled_from([0, SPAN - 10**6]),
)  # fmt: skip
def test_no_pattern_gives_out_more_than_came_in(
    pattern: dict[str, float],
    delay: float,
    rates: tuple[float, float],
    newest: bool,
    repeated: int,
    seed: int,
    stretch: float,
    begin: int,
) -> None:
    """To the bit, at every tick; and, independently of any counter, in floats."""
    period, slot = rates
    p = receiver_params(period, sender_period=slot, depth=0.01, newest=newest)
    way = network_params(delay, **pattern)  # type: ignore[arg-type]
    run = run_line(
        p, way, waves_of(seed, 400), ticks=800, repeated=repeated, seed=seed, begin=begin,
        stretch=stretch,
    )  # fmt: skip
    assert run.least >= 0
    reserve = ENERGY_QUANTUM * p.reserve
    assert joules(run.given, period) <= joules(run.sent, slot) + reserve + 1e-15


def test_without_the_limit_energy_the_test_would_see_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def spendthrift(
        p: ReceiverParams, funds: int, rest: int, timely: int, mean: float, want: float
    ) -> int:
        return output_wave(p, 1 << 50, rest, timely, mean, want)

    monkeypatch.setattr("tautwave.link.receiver.output_wave", spendthrift)
    way = network_params(0.0, outage_at=0.1, outage=0.1)
    assert run_line(equal_rates(), way, [1.0] * 400, ticks=800).least < 0


@pytest.mark.parametrize("begin", [0, SPAN - 10**9])
def test_in_time_it_is_a_line_of_constant_delay(begin: int) -> None:
    """Nothing is cut: what comes out is what was sent, to a quantum of the integral."""
    run = run_line(equal_rates(), network_params(0.01), waves_of(2), ticks=2000, begin=begin)
    slots = 20 + 20  # the network's, and the depth
    for slot, wave in enumerate(run.sent[: 2000 - slots]):
        assert abs(run.given[slot + slots] - wave) <= 1.01 * WAVE_QUANTUM / PERIOD
    assert run.given[: slots - 1] == [0.0] * (slots - 1)


@pytest.mark.parametrize(
    "way",
    [
        network_params(0.01, loss=0.1),
        network_params(0.01, jitter=0.009),
        network_params(0.01, jitter=0.002, loss=0.2, duplicates=0.1),
    ],
)
def test_what_the_depth_and_the_repetition_cover_is_not_felt_at_all(way: object) -> None:
    """As smooth as a clean line: it is one, of the least delay and the depth."""
    clean = run_line(equal_rates(), network_params(0.01), waves_of(2), ticks=2500)
    run = run_line(equal_rates(), way, waves_of(2), ticks=2500, repeated=7)  # type: ignore[arg-type]
    # The pointer slips to where it belongs within two blocks, by the slack at most beside it.
    late = 1200
    settled = min(
        max(abs(run.given[k + s] - clean.given[k]) for k in range(late, 1500)) for s in range(-2, 3)
    )
    assert settled < 1e-8


@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("newest", [False, True])
def test_after_any_loss_the_integral_is_delivered(rates: tuple[float, float], newest: bool) -> None:
    """Claim 4: energy always suffices for the backlog, though half of all packets are lost."""
    period, slot = rates
    p = receiver_params(period, sender_period=slot, depth=0.01, newest=newest)
    way = network_params(0.01, jitter=0.005, loss=0.5, burst=4.0, outage_at=0.2, outage=0.1)
    sent = [0.8] * round(0.5 / slot) + [0.0]
    run = run_line(p, way, sent, ticks=round(3.0 / period), repeated=2, seed=5)
    assert abs(run.backlog) < 1e-5  # the outage alone cost 0.08 W**0.5 s
    assert run.least >= 0


def test_energy_lasts_as_long_as_the_backlog() -> None:
    """After an outage the first ticks do not spend all: force comes back, and stays."""
    way = network_params(0.0, outage_at=0.2, outage=0.3)
    run = run_line(equal_rates(), way, [0.5] * 1400, ticks=1500)
    after = run.given[1000:1380]
    assert max(after) < 0.75
    assert min(after[60:]) > 0.45


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_repayment_after_an_outage_is_bounded_in_speed(sign: float) -> None:
    fastest = 0.2
    way = network_params(0.0, outage_at=0.2, outage=0.3)
    waves = [0.5 * sign] * 1000
    slow = run_line(equal_rates(fastest=fastest), way, waves, ticks=3000)
    quick = run_line(equal_rates(), way, waves, ticks=3000)
    assert max(map(abs, slow.given)) <= 0.5 + fastest + 1e-9
    assert max(map(abs, quick.given)) > 0.5
    assert abs(slow.backlog) < 1e-6


def test_starved_it_waits_and_invents_nothing() -> None:
    way = network_params(0.0, outage_at=0.2, outage=10.0)
    run = run_line(equal_rates(), way, [0.5] * 1000, ticks=1000)
    assert run.given[-400:] == [0.0] * 400
    assert run.receiver.pointer == run.receiver.newest


@pytest.mark.sparse(2)
@pytest.mark.parametrize("stretch", [200e-6, -200e-6])
def test_clocks_that_differ_cost_slips_and_no_position(stretch: float) -> None:
    """10 s at 200 ppm are four slots of 2 kHz; the pointer stays as far behind as it should."""
    waves = waves_of(3, 20_000, noise=0.05)
    leads: list[int] = []

    def look(run: Run) -> None:
        leads.append(run.receiver.newest - run.receiver.pointer)

    p = equal_rates()
    run = run_line(p, network_params(0.002), waves, ticks=20_400, stretch=stretch, look=look)
    assert max(leads[-2000:-400]) in range(p.depth - 2, p.depth + 3)
    assert abs(run.backlog) < 2e-5
    assert run.least >= 0


def test_what_a_loss_averages_out_is_not_hoarded() -> None:
    """Noise that a lost stretch took with it leaves energy, which nobody may keep."""
    run = run_line(
        equal_rates(level=1e-4), network_params(0.01, loss=0.4, burst=10.0), waves_of(4),
        ticks=2500, repeated=0,
    )  # fmt: skip
    assert run.receiver.dropped > 0.01
    assert run.funds == pytest.approx(1e-4, rel=1e-3)  # the level: kept, for slips
    given_out = joules(run.given, PERIOD)
    assert given_out + run.receiver.dropped + run.funds == pytest.approx(
        joules(run.sent, PERIOD), rel=1e-9
    )


def test_of_what_comes_at_once_as_much_is_in_time_as_its_energy_pays_at_once() -> None:
    """The newest wave after a gap brings several slots: together they cost their square."""
    p = equal_rates(newest=1.0)
    energy = round(p.scale * 1e18)
    assert timely_wave(p, 3 * 10**9, 3 * energy) == pytest.approx(10**9, rel=1e-6)
    assert timely_wave(p, 10**9, energy) == 10**9
    grown = []
    way = network_params(0.0, loss=0.3, burst=3.0)
    run_line(
        p,
        way,
        [0.5] * 900,
        ticks=900,
        repeated=0,
        look=lambda run: grown.append(run.receiver.growth),
    )
    assert max(grown) * WAVE_QUANTUM / PERIOD == pytest.approx(0.5, rel=1e-6)


def test_a_depth_that_follows_finds_what_the_network_needs() -> None:
    period = 2e-3
    way = network_params(0.01, jitter=0.008)  # four slots
    depths: list[int] = []
    late = {}
    for name, deepest in (("follows", 0.05), ("stays", 0.0)):
        p = receiver_params(period, sender_period=period, depth=0.0, deepest=deepest)
        waits: list[int] = []

        def look(run: Run, waits: list[int] = waits) -> None:
            depths.append(run.receiver.depth)
            waits.append(run.receiver.pointer)

        run = run_line(p, way, [1.0] * 3000, ticks=2500, repeated=0, look=look)
        late[name] = sum(one == two for one, two in pairwise(waits[500:]))
        assert run.least >= 0
    assert 3 <= depths[2499] <= 4
    assert max(depths) <= 4
    assert late["follows"] < 0.25 * late["stays"]


def test_a_deep_buffer_on_a_calm_network_becomes_shallow_slot_by_slot() -> None:
    period = 10e-3
    p = receiver_params(period, sender_period=period, depth=0.03, deepest=0.05)
    depths: list[int] = []
    run_line(
        p, network_params(0.01), [1.0] * 6000, ticks=6000,
        look=lambda run: depths.append(run.receiver.depth if run.receiver.begun else 3),
    )  # fmt: skip
    changes = [k for k in range(1, 6000) if depths[k] != depths[k - 1]]
    assert [depths[k] for k in changes] == [2, 1, 0]
    assert all(later - sooner > 1000 for sooner, later in pairwise([0, *changes]))


def test_what_was_long_ago_counts_less() -> None:
    p = equal_rates()
    share = 0.0
    for since in range(p.watch):
        share = watched(p, share, since % 4 == 0, since)
    assert share == pytest.approx(0.25, rel=1e-3)
    for since in range(p.watch, 3 * p.watch):
        share = watched(p, share, False, since)
    assert share == pytest.approx(0.25 * math.exp(-2.0), rel=1e-3)


def test_a_depth_that_is_needed_stays() -> None:
    period = 10e-3
    p = receiver_params(period, sender_period=period, depth=0.04, deepest=0.05)
    depths: list[int] = []
    run_line(
        p, network_params(0.01, jitter=0.04), [1.0] * 5000, ticks=5000, repeated=0,
        look=lambda run: depths.append(run.receiver.depth),
    )  # fmt: skip
    assert min(depths[100:]) >= 2
    assert depths.count(2) < 500


def test_it_grows_no_deeper_than_it_may() -> None:
    period = 2e-3
    p = receiver_params(period, sender_period=period, depth=0.0, deepest=0.004)
    way = network_params(0.01, jitter=0.03)
    run = run_line(p, way, [1.0] * 3000, ticks=2900, repeated=0)
    assert run.receiver.depth == 2


def test_a_slip_backwards_repeats_what_there_was_and_is_not_felt() -> None:
    """A receiver whose clock is fast, with energy to spare: the force never drops."""
    p = equal_rates(reserve=1e-2)
    run = run_line(p, network_params(0.002), [0.5] * 20_000, ticks=19_000, stretch=-200e-6)
    assert run.receiver.pointer < run.receiver.newest - p.depth + 3
    assert min(run.given[1000:]) > 0.45


@pytest.mark.parametrize(("owed", "step", "timely"), [(3, 2, 1), (-3, 0, -1)])
def test_slips_are_made_one_in_a_tick(owed: int, step: int, timely: int) -> None:
    p = equal_rates()
    left = owed
    for expected in range(abs(owed) - 1, -1, -1):
        *moved, _, _, left = advance(p, p.depth, p.depth + 5, 0, 0, left)
        assert moved == [step, timely]
        assert abs(left) == expected
    *moved, _, _, left = advance(p, p.depth, p.depth + 5, 0, 0, left)
    assert (moved, left) == ([1, 1], 0)


def test_what_came_is_not_taken_back_where_a_late_packet_says_less() -> None:
    p = equal_rates()
    places = ring_size(p)
    ring = [0.0] * (PLACE * places)
    r = Receiver()
    start_receiver(r, ring, 0, places)
    r.begun = True
    r.pointer = -1
    take_pair(r, p, ring, 0, places, 9, 0, 1000)
    play_to(r, p, ring, 0, places, 4)
    assert r.paid == 500
    take_pair(r, p, ring, 0, places, 5, 0, 100)
    play_to(r, p, ring, 0, places, 5)
    assert r.paid == 500
    play_to(r, p, ring, 0, places, 9)
    assert r.paid == 1000


def test_a_session_begins_with_what_a_new_record_has() -> None:
    p = equal_rates()
    places = ring_size(p)
    table = [7.0] * (1 + PLACE * places + 1)
    r, s = Receiver(), Sender()
    for record, field in ((one, field) for one in (r, s) for field in fields(one)):
        setattr(record, field.name, type(getattr(record, field.name))(7))
    start_receiver(r, table, 1, places)
    start_sender(s)
    assert (r, s) == (Receiver(), Sender())
    emptied = range(1, PLACE * places, PLACE)
    assert all((value != 7.0) == (k in emptied) for k, value in enumerate(table))
    other = {k: v for one in (r, s) for k, v in asdict(one).items() if v}
    assert other == {"newest": -1, "best": LOWEST, "slot": -1}


def placed(paid: float = 0.0, backlog: float = 0.0) -> tuple[Receiver, ReceiverParams]:
    """Return a receiver that holds energy [J] beyond its reserve, and owes [W**0.5 s]."""
    p = equal_rates(level=1e-4)
    r = Receiver()
    r.begun = True
    r.paid = round(paid / ENERGY_QUANTUM)
    r.played = round(backlog / WAVE_QUANTUM)
    return r, p


@pytest.mark.parametrize(("asked", "granted"), [(0.0, 0.0), (3e-4, 3e-4), (1.0, 9e-4)])
def test_what_is_too_much_is_sent_back_as_far_as_it_is_wanted(asked: float, granted: float) -> None:
    """1 mJ where 0.1 are kept: the rest goes to who asked for it, or is dropped and booked."""
    r, p = placed(1e-3)
    take_credit(r, 0, round(asked / ENERGY_QUANTUM))
    settle(r, p, funds_of(r, p))
    assert r.granted * ENERGY_QUANTUM == pytest.approx(granted, abs=1e-11)
    assert r.dropped == pytest.approx(9e-4 - granted, abs=1e-11)
    assert funds_of(r, p) - p.reserve == pytest.approx(p.level, abs=1)
    settle(r, p, funds_of(r, p))
    assert r.granted * ENERGY_QUANTUM == pytest.approx(granted, abs=1e-11)


def test_a_backlog_keeps_the_energy_that_it_may_need() -> None:
    r, p = placed(1e-3, backlog=5e-4)
    settle(r, p, funds_of(r, p))
    needed = (5e-4) ** 2 / (2.0 * PERIOD)
    assert r.dropped == pytest.approx(9e-4 - needed, abs=1e-11)


def test_credit_pays_for_what_is_owed_and_is_asked_for_again() -> None:
    r, p = placed(backlog=1e-3)
    r.spent = p.reserve  # nothing left: it owes, and can give nothing
    settle(r, p, funds_of(r, p))
    assert output_wave(p, funds_of(r, p), 10**9, 0, 0.0, wanted_wave(p, 10**9, 0)) == 0
    assert r.asked == p.reserve + p.level
    take_credit(r, r.asked, 0)
    assert funds_of(r, p) == p.reserve + p.level
    assert output_wave(p, funds_of(r, p), 10**9, 0, 0.0, wanted_wave(p, 10**9, 0)) > 0
    settle(r, p, funds_of(r, p))
    assert r.asked == r.was_granted


def test_the_least_delay_is_looked_for_in_blocks_of_that_many_ticks() -> None:
    p = receiver_params(PERIOD, sender_period=PERIOD, depth=DEPTH_S)
    depth, ahead = 5, p.down + 5
    assert advance(p, depth, ahead, 5, p.block - 2, 0)[2:] == (5, p.block - 1, 0)
    _, _, best, ticks, owed = advance(p, depth, ahead, 5, p.block - 1, 0)
    assert (best < 0, ticks, owed) == (True, 0, 0)
