"""Two clocks by echoes: offset, rate, and slots that follow without a step."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.link.clocks import (
    MAX_SLEW,
    WINDOWS,
    Exchange,
    clock_doubt,
    clock_line,
    exchange,
    keep_best,
    slot_stretch,
)

AHEAD_S = 3.25
RATE = 30e-6


def estimates(
    jitter: float, out: float = 0.01, back: float = 0.01, seconds: int = 30
) -> tuple[np.ndarray, np.ndarray]:
    """Return errors of single packets, and of the line once its windows are full [s]."""
    rng = np.random.default_rng(7)
    sent = 5e-3 * np.arange(200 * seconds)
    there = sent + out + rng.exponential(jitter, len(sent))
    came = there + 2e-3 + back + rng.exponential(jitter, len(sent))
    single, lines = [], []
    best: tuple[Exchange, ...] = ()
    for k in np.argsort(came):
        truth = AHEAD_S + RATE * came[k]
        clock = (there[k] + 2e-3) * (1.0 + RATE) + AHEAD_S
        found = exchange(*(round(1e9 * t) for t in (came[k], clock, sent[k], 2e-3)))
        best = keep_best(best, found)
        single.append(found.offset - truth)
        if came[k] > WINDOWS + 1.0:
            lines.append(clock_line(best, came[k])[0] - truth)
    assert len(best) == WINDOWS + 1
    assert clock_line(best, 0.0)[1] == pytest.approx(RATE, abs=0.2 * jitter / 30)
    return np.array(single), np.array(lines)


@pytest.mark.parametrize(("jitter", "worst"), [(2e-3, 250e-6), (0.1e-3, 15e-6)])
def test_the_least_round_trips_find_the_offset_through_jitter(jitter: float, worst: float) -> None:
    single, lines = estimates(jitter)
    assert np.abs(lines).max() < worst
    assert np.abs(lines).max() < 0.2 * single.std()


def test_unlike_ways_enter_by_half_and_stay_inside_half_the_round_trip() -> None:
    _, lines = estimates(0.1e-3, out=0.015, back=0.005)
    assert np.mean(lines) == pytest.approx(0.005, abs=20e-6)
    assert np.abs(lines).max() < (0.015 + 0.005) / 2


@pytest.mark.parametrize("seed", range(5))
def test_the_doubt_covers_whatever_the_ways_were_like(seed: int) -> None:
    """Also where loops that look once a period make one window's round trip short by chance."""
    rng = np.random.default_rng(seed)
    best: tuple[Exchange, ...] = ()
    for k in range(12):
        out, back = rng.uniform(0.0, 1e-3, 2) * (0.05 if k == 4 else 1.0)
        came = 1.0 * k + 0.5
        times = (came, came - back + AHEAD_S, came - back - out, 0.0)
        best = keep_best(best, exchange(*(round(1e9 * t) for t in times)))
    middle = sum(one.at for one in best[1:]) / len(best[1:])
    assert abs(clock_line(best, middle)[0] - AHEAD_S) <= clock_doubt(best) + 1e-9
    assert clock_doubt(best) > min(one.round_trip for one in best)  # half of it would be too little
    assert clock_doubt(best[:1]) == 0.5 * best[0].round_trip
    assert clock_doubt(()) == np.inf


def test_what_came_while_a_clock_stood_still_says_nothing_of_the_other() -> None:
    kept = (Exchange(1.0, AHEAD_S, 0.02),)
    asleep = exchange(2_000_000_000, 5_000_000_000, 1_500_000_000, 600_000_000)
    assert keep_best(kept, asleep) == kept


def test_before_anything_came_nothing_is_said() -> None:
    assert clock_line((), 5.0) == (0.0, 0.0)
    assert clock_line((Exchange(1.0, 0.25, 0.02),), 5.0) == (0.25, 0.0)


@pytest.mark.parametrize("rate", [-150e-6, 0.0, 100e-6])
def test_slots_follow_the_leader_without_a_step(rate: float) -> None:
    period, late, stretch = 1e-3, 3e-3, []
    for _ in range(400):
        share = slot_stretch(rate, late, settle=4.0)
        assert abs(share) <= MAX_SLEW
        stretch.append(share)
        # In 0.1 s the leader's slots shorten by `rate`, the follower's by what it was sent.
        late += 0.1 * (rate + share)
    assert abs(late) < 0.02 * period
    assert stretch[-1] == pytest.approx(-rate, abs=5e-6)


def test_a_clock_too_fast_is_not_followed_beyond_the_slew() -> None:
    assert slot_stretch(300e-6, 0.0, 4.0) == -MAX_SLEW
    assert slot_stretch(0.0, -1.0, 4.0) == MAX_SLEW
