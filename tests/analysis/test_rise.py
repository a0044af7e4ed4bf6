"""What a coupling generated, by its rows: closed forms, synthetic rows, and what can hide it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.analysis.claim import NOTHING
from tautwave.analysis.rise import (
    ACCURACY,
    Floats,
    Rise,
    clipped_potential,
    damping_work,
    feigned_by_noise,
    rise_of,
    surplus_of,
)

T = 1e-3
K = 800.0


def rise_of_motion(
    x: Floats,
    damping: float,
    *,
    clip: float = np.inf,
    kept: Floats | None = None,
    seen: Floats | None = None,
    variance: float = 0.0,
) -> Rise:
    """Return the rise of a spring K between two ends at `x`, (2, samples), sampled and held.

    `kept`: the samples that were not lost (at both ends together); `seen`: the positions as the
    encoders show them, with noise of `variance` that the books know of.
    """
    shown = x if seen is None else seen
    at = np.arange(x.shape[1]) if kept is None else np.flatnonzero(kept)
    stretch = shown[0, at] - shown[1, at]
    moved = np.diff(shown[:, at], axis=1)
    lasted = np.diff(at) * T
    effort = np.clip(K * stretch, -clip, clip)[:-1]
    taken = effort * (moved[0] - moved[1])
    given = np.diff(clipped_potential(K, min(clip, 1e9), stretch)) - taken
    damped = damping_work(damping, moved[0], lasted) + damping_work(damping, moved[1], lasted)
    noise = 2.0 * feigned_by_noise(damping, K, variance, lasted)
    flow = float(np.abs(taken).sum())
    return rise_of(at * T, given, damped, noise, np.ones(len(lasted), bool), flow)


def test_the_potential_of_a_clipped_spring_has_the_clip_for_its_slope() -> None:
    stretch = np.linspace(-3.0, 3.0, 6001)
    energy = clipped_potential(K, 500.0, stretch)
    inside = np.abs(stretch) < 500.0 / K
    assert energy[inside] == pytest.approx(0.5 * K * stretch[inside] ** 2, abs=1e-12)
    beyond = 500.0 * np.abs(stretch[~inside]) - 500.0**2 / (2.0 * K)
    assert energy[~inside] == pytest.approx(beyond, rel=1e-12)
    middle = 0.5 * (stretch[1:] + stretch[:-1])
    assert np.diff(energy) / np.diff(stretch) == pytest.approx(
        np.clip(K * middle, -500.0, 500.0), abs=0.5 * K * 1e-3
    )


def test_a_dither_gives_what_the_hold_leaks_less_what_damping_takes() -> None:
    """Both ends jump by 2a against each other in each period: K (4a)^2/2 less 2 d (2a)^2/T."""
    a, periods, damping = 1e-3, 4000, 0.5 * K * T
    x = a * np.outer([1.0, -1.0], (-1.0) ** np.arange(periods + 1))
    found = rise_of_motion(x, damping)
    leaked = 8.0 * K * a**2 * periods
    taken = 8.0 * damping * a**2 / T * periods
    assert found.given == pytest.approx(leaked - taken, rel=1e-9)
    assert found.taken == pytest.approx(taken, rel=1e-9)
    assert found.floor == pytest.approx(ACCURACY * taken, rel=1e-6)
    assert found.lasting
    assert found.share == 1.0
    assert found.exceeds(10.0 * found.given)  # no claim is for what goes on
    just = rise_of_motion(x, K * T)  # what passivity by tuning asks of two equal devices
    assert just.given <= just.floor
    assert not just.exceeds(0.0)


motions = st.tuples(st.integers(0, 2**32 - 1), st.sampled_from([1e-5, 1e-3, 0.3]))


@given(motions, st.floats(1.0, 1e6), st.floats(0.1, 1.0), st.booleans())
def test_no_motion_makes_a_passive_coupling_rise(
    motion: tuple[int, float], clip: float, share: float, slow: bool
) -> None:
    """Any motion of both ends, any clip: K T / 2 <= d1 d2 / (d1 + d2), here with d1 = d2 = K T."""
    rng = np.random.default_rng(motion[0])
    x = motion[1] * rng.standard_normal((2, 300))
    x = np.cumsum(x, axis=1) if slow else x
    x[1] = share * x[0] + (1.0 - share) * x[1]
    found = rise_of_motion(x, K * T, clip=clip)
    assert found.given <= found.floor


@given(st.floats(1e-5, 0.3), st.integers(2, 12))
def test_a_gap_leaks_as_many_times_what_damping_was_chosen_for(a: float, gap: int) -> None:
    """A dither over gaps of n periods, that lost samples or a stall made: the damping takes 1/n."""
    x = a * np.outer([1.0, -1.0], (-1.0) ** (np.arange(2001) // gap))
    kept = np.arange(2001) % gap == 0
    found = rise_of_motion(x, K * T, kept=kept)
    gaps = int(np.count_nonzero(kept)) - 1
    assert found.given == pytest.approx(gaps * 8.0 * a**2 * K * (1.0 - 1.0 / gap), rel=1e-9)
    assert found.exceeds(0.0)


def test_a_gain_is_found_with_its_moments() -> None:
    """From the start alone, what was lost before would have paid for it."""
    time = np.arange(0.0, 8.0, T)
    steps = np.full(len(time) - 1, -1e-6)
    steps[3000:3100] += 2e-3
    nothing = np.zeros_like(steps)
    found = rise_of(time, steps, nothing, nothing, np.ones(len(steps), bool), 1.0)
    assert found.given == pytest.approx(100 * (2e-3 - 1e-6))
    assert (found.begin_s, found.end_s) == pytest.approx((3.0, 3.1))
    assert found.share == pytest.approx(1 / 8)
    assert not found.lasting
    assert found.exceeds(0.19)
    assert not found.exceeds(0.2)
    apart = np.ones(len(steps), bool)
    apart[2990:3110] = False  # a stop acted there
    assert rise_of(time, steps, nothing, nothing, apart, 1.0).given == 0.0


@pytest.mark.parametrize(
    ("seconds", "of", "lasting"), [(5, 20, False), (6, 20, True), (1, 1, False), (2, 4, False)]
)
def test_it_goes_on_in_more_than_a_quarter_of_the_seconds(
    seconds: int, of: int, lasting: bool
) -> None:
    """And in more than two: a run of a second or two says nothing of going on."""
    time = np.arange(0.0, of + T / 2, T)
    steps = np.where(np.floor(time[:-1] + T / 4) % of < seconds, 1e-6, 0.0)
    nothing = np.zeros_like(steps)
    found = rise_of(time, steps, nothing, nothing, np.ones(len(steps), bool), 1.0)
    assert found.lasting == lasting
    assert found.exceeds(1.0) == lasting


def test_noise_is_no_motion() -> None:
    """Ends at rest, encoders not: leak and damping that books see in it are both taken back."""
    deviation, damping, periods = 2e-4, 3.0 * K * T, 20_000
    rest = np.zeros((2, periods))
    seen = deviation * np.random.default_rng(5).standard_normal((2, periods))
    blind = rise_of_motion(rest, damping, seen=seen)
    found = rise_of_motion(rest, damping, seen=seen, variance=deviation**2)
    feigned = 2.0 * (2.0 * damping / T - K) * deviation**2 * periods
    assert blind.taken == pytest.approx(4.0 * damping / T * deviation**2 * periods, rel=0.02)
    assert found.taken == pytest.approx(blind.taken - feigned, rel=0.02)
    assert blind.given == 0.0  # it could hide as much as it feigns
    assert found.given < 0.3 * found.floor


def test_noise_hides_no_generation() -> None:
    """A dither that generates in its gaps, between noise that the books take for damping."""
    deviation, damping, periods, gap = 2e-4, 3.0 * K * T, 20_000, 4
    noise = deviation * np.random.default_rng(5).standard_normal((2, periods))
    late = np.arange(periods) >= periods // 2
    dither = 1.5 * deviation * np.outer([1.0, -1.0], (-1.0) ** (np.arange(periods) // gap))
    x = np.where(late, dither, 0.0)
    kept = ~late | (np.arange(periods) % gap == 0)
    true = rise_of_motion(x, damping, kept=kept)
    assert true.exceeds(0.0)
    hidden = rise_of_motion(x, damping, kept=kept, seen=x + noise)
    found = rise_of_motion(x, damping, kept=kept, seen=x + noise, variance=deviation**2)
    assert found.given == pytest.approx(true.given, rel=0.2)
    assert abs(hidden.given - true.given) > 2.0 * abs(found.given - true.given)


def test_what_is_given_back_is_no_surplus() -> None:
    """A spring that nobody accounts for: stretched and let go in each second, it gives nothing."""
    time = np.arange(0.0, 10.0, T)
    given = -1e-2 * (1.0 - np.cos(2.0 * np.pi * time))
    free = np.zeros_like(time)
    assert surplus_of(time, given, free, 1.0).given == 0.0
    leaking = given + 1e-3 * time
    found = surplus_of(time, leaking, free, 1.0)
    assert found.given == pytest.approx(1e-2, rel=1e-3)
    assert found.lasting
    assert surplus_of(time, leaking, 1.1e-3 * time, 1.0).given == 0.0


def test_where_nothing_moved_nothing_was_generated() -> None:
    time = np.arange(0.0, 5.0, T)
    dust = 1e-17 * np.random.default_rng(1).standard_normal(len(time) - 1)
    nothing = np.zeros_like(dust)
    found = rise_of(time, dust, nothing, nothing, np.ones(len(dust), bool), 0.0)
    assert found.floor == NOTHING
    assert not found.exceeds(0.0)
