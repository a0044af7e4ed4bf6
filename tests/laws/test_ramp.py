"""An effort that falls slowly gives out no more than was there, and no bound is much too low."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.port import port_bounded, port_effort, port_params
from tautwave.laws.ramp import (
    NO_RAMP,
    ramp_bound,
    ramp_params,
    ramped_effort,
    stall_bound,
    stall_ceiling,
    stall_params,
)

T = 1e-3
SIZES = st.floats(-3.0, 1.0).map(lambda power: 10.0**power)


def given_out(mass: float, rate: float, effort: float, against: float) -> float:
    """Return what an effort gives a free mass from its next command on [J], but not what it took.

    While the mass still moves against the effort it is taken from, which counts for nothing here.
    """
    speed = against
    effort -= rate * T
    while effort > 0.0:
        speed -= effort * T / mass
        effort -= rate * T
    start = min(against, 0.0)
    return 0.5 * mass * (min(speed, 0.0) ** 2 - start * start)


@given(SIZES, SIZES, st.integers(2, 400), st.floats(-1.0, 1.0), SIZES)
def test_what_the_bound_allows_gives_out_what_is_there(
    mass: float, step: float, periods: int, part: float, energy: float
) -> None:
    """Of whole ramps, whose sum of samples has no remainder; against and with the motion."""
    rate = step / T
    impulse = 0.5 * rate * T * T * periods * (periods - 1)
    against = part * impulse / mass
    p = ramp_params(T, mass, rate)
    bound = ramp_bound(p, energy, against)
    assert bound >= 2.0 * p.half_step
    # At the bound a whole number of steps below and one above bracket what is there.
    count = math.floor(bound / (rate * T) * (1.0 + 1e-12))
    assert given_out(mass, rate, count * rate * T, against) <= energy * (1.0 + 1e-6) + 1e-15
    assert given_out(mass, rate, (count + 1) * rate * T, against) >= energy * (1.0 - 1e-6)


def test_with_nothing_to_spend_it_is_the_parabola_of_the_shortest_stop() -> None:
    """F**2 / 2R = m u, in a period short beside the ramp."""
    p = ramp_params(1e-9, 2e-3, 5.0)
    assert ramp_bound(p, 0.0, 3.0) == pytest.approx(math.sqrt(2.0 * 5.0 * 2e-3 * 3.0), rel=1e-6)
    assert ramp_bound(p, 0.0, -3.0) == pytest.approx(2.0 * p.half_step)
    assert ramp_bound(p, -1.0, 0.0) == 2.0 * p.half_step


def test_at_rest_a_tank_bears_the_fourth_root() -> None:
    """A = F**4 / 8 R**2 m: the impulse of the ramp as motion."""
    rate, mass, effort = 4.0, 1e-3, 0.3
    energy = effort**4 / (8.0 * rate * rate * mass)
    assert ramp_bound(ramp_params(1e-9, mass, rate), energy, 0.0) == pytest.approx(effort, rel=1e-6)


@given(SIZES, SIZES, st.floats(-10.0, 10.0), st.floats(-5.0, 5.0))
def test_an_effort_is_only_made_smaller_and_mirrors(
    rate: float, energy: float, velocity: float, effort: float
) -> None:
    """Never turned, never raised, the same on both sides; and free of any bound at once."""
    p = ramp_params(T, 1e-3, rate)
    found = ramped_effort(p, energy, velocity, effort)
    assert 0.0 <= math.copysign(found, found * effort) <= abs(effort)
    assert ramped_effort(p, energy, -velocity, -effort) == -found
    assert ramped_effort(ramp_params(T, 1e-3, math.inf), energy, velocity, effort) == effort


@pytest.mark.parametrize("effort", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_reaches_the_guard(effort: float) -> None:
    """A bound that hides NaN would hide a coupling that has failed."""
    found = ramped_effort(ramp_params(T, 1e-3, 2.0), 0.01, 0.0, effort)
    assert found == effort or (math.isnan(found) and math.isnan(effort))


def test_a_port_s_effort_is_bounded_and_a_rich_or_fast_one_is_not() -> None:
    """The port hands on its tank and the velocity where the effort acts."""

    def port(rate: float) -> float:
        p = port_params(T, 0.05, 1e-3, reserve=0.01, effort_rate=rate)
        now = (account, 4.0, 10.0, 0.02)
        return port_bounded(p, *now, port_effort(p, *now, 0.0))

    account = 1e-5
    free = port(math.inf)
    assert port(1e6) == free
    free_velocity = 4.0 + 0.5 * T * 10.0 - T / 1e-3 * 0.02
    assert port(1.0) == ramp_bound(ramp_params(T, 1e-3, 1.0), account, free_velocity) < 0.6 * free
    account = 1.0
    assert port(1.0) == free


def test_without_a_rate_limit_there_is_no_ramp() -> None:
    """Also for a port of no mass that takes velocities."""
    assert ramp_params(T, 1e-3, math.inf) == NO_RAMP
    assert port_params(T, 0.05, math.inf, reserve=1.0).ramp == NO_RAMP
    assert ramp_bound(NO_RAMP, 0.0, 0.0) == math.inf


def gained(mass: float, rate: float, hold: float, effort: float, along: float) -> float:
    """Return what an effort held for so long, then taken away, gives a free mass [J]."""
    impulse = effort * hold + (0.0 if math.isinf(rate) else 0.5 * effort * effort / rate)
    return impulse * along + 0.5 * impulse * impulse / mass


@given(SIZES, st.one_of(SIZES.map(lambda size: 1e3 * size), st.just(math.inf)), SIZES, SIZES,
       st.floats(0.0, 20.0), st.floats(0.0, 2.0), st.floats(-1.0, 1.0))  # fmt: skip
def test_a_stall_gives_a_free_mass_what_the_bound_allows(
    mass: float, rate: float, hold: float, energy: float, along: float, doubt: float, error: float
) -> None:
    """Exactly that where the velocity is known; no more where it is off by what is doubted."""
    sure = stall_params(hold, mass, rate, energy)
    assert gained(mass, rate, hold, stall_bound(sure, along), along) == pytest.approx(energy)
    unsure = stall_params(hold, mass, rate, energy, doubt)
    true = max(0.0, along + error * doubt)
    bound = stall_bound(unsure, along)
    assert gained(mass, rate, hold, bound, true) <= energy * (1.0 + 1e-9)
    assert bound <= stall_bound(sure, along)


@given(SIZES, SIZES, st.floats(0.0, 20.0), st.floats(0.0, 10.0), st.floats(1.0, 50.0))
def test_a_heavier_device_gains_no_more(
    energy: float, half_mobility: float, velocity: float, impulse: float, heavier: float
) -> None:
    """What it had and what moved it are known, its mass is not: at least 1 here."""
    p = stall_params(0.02, 1.0, 100.0, energy)
    free_velocity = velocity - half_mobility * impulse
    true = velocity - half_mobility * impulse / heavier
    for side in (1.0, -1.0):
        effort = stall_ceiling(p, velocity, free_velocity, side, math.inf)
        along = max(0.0, -side * true)
        assert gained(heavier, 100.0, 0.02, effort, along) <= energy * (1.0 + 1e-9)


def test_a_device_that_moves_against_the_effort_may_be_stopped_by_what_is_outside() -> None:
    p = stall_params(0.02, 1e-3, 700.0, 0.1)
    assert stall_bound(p, -5.0) == stall_bound(p, 0.0) > stall_bound(p, 5.0)
    assert stall_ceiling(p, 3.0, 3.0, 1.0, 9.0) == stall_bound(p, 0.0)
    assert stall_ceiling(p, 3.0, 3.0, -1.0, 9.0) == stall_bound(p, 3.0)
    assert stall_ceiling(p, 3.0, 3.0, -1.0, 0.1) == 0.1


def test_an_effort_kept_for_a_load_is_part_of_what_is_held() -> None:
    bare, loaded = (stall_params(0.02, 1e-3, 700.0, 0.1, 0.0, kept) for kept in (0.0, 0.3))
    assert stall_bound(loaded, 0.0) == pytest.approx(stall_bound(bare, 0.0) - 0.3)
    assert stall_bound(loaded._replace(kept=50.0), 0.0) == 0.0
    assert stall_bound(stall_params(0.02, 1e-3, 700.0, 1e-300), 0.0) >= 0.0
