"""The account: what its gate lets through gives no more than the funds, its counters never more."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.account import (
    AccountParams,
    brake_effort,
    close_account,
    credit_due,
    credit_received,
    gate_bounds,
    is_covered,
    level_friction,
    level_missing,
    planned_bounds,
)

T = 1e-3
M = 0.5
"""Half mobility of a device of 1e-3 kg m**2."""

P = AccountParams(
    reserve=1e-3,
    debt=2e-3,
    least=0.5e-3,
    mark=1e-3,
    full=4e-3,
    capacity=1e-2,
    income=0.0,
    share=1.0,
    level_damping=0.0,
    edge=0.7,
)

speeds = st.floats(-50.0, 50.0)
funds = st.floats(-1.0, 1.0)


def planned_gift(effort: float, free_velocity: float) -> float:
    """What an effort gives if the device moves as predicted [J]."""
    return -effort * T * (free_velocity - M * effort)


@given(funds, speeds, st.floats(0.0, 1.0), st.floats(0.0, 2.0))
def test_no_effort_within_the_bounds_plans_to_give_more_than_the_funds(
    held: float, free_velocity: float, share: float, edge: float
) -> None:
    p = P._replace(edge=edge)
    low, high = gate_bounds(p, held, free_velocity, M, T)
    assert low <= 0.0 <= high
    most = max(held, 0.0)
    for effort in (low, high, low + share * (high - low)):
        assert planned_gift(effort, free_velocity) <= most + 1e-9 * (
            most + free_velocity * free_velocity
        )


@given(funds, speeds, speeds, st.floats(0.1, 1.0))
def test_smoothing_allows_nothing_that_the_velocity_does_not(
    held: float, free_velocity: float, smooth: float, share: float
) -> None:
    p = P._replace(share=share)
    low, high = planned_bounds(p, held, free_velocity, smooth, M, T)
    least, most = gate_bounds(p, share * held, free_velocity, M, T)
    assert least <= low <= 0.0 <= high <= most


@given(
    st.floats(-1e-6, 1e-2),
    speeds,
    speeds,
    st.floats(0.1, 1.0),
    st.sampled_from((0.0, 0.7, 2.0)),
    st.one_of(
        st.floats(-2.0, 2.0), st.sampled_from((1.0, 1.0 - 1e-9, 1.0 + 1e-12, 1.0 - 1e-15, 0.0))
    ),
    st.booleans(),
)
def test_a_covered_effort_is_not_cut_by_the_bounds(
    held: float, v: float, smooth: float, share: float, edge: float, of: float, up: bool
) -> None:
    """To the last bit, for efforts about the bounds too: what `SURELY` is for."""
    p = P._replace(share=share, edge=edge)
    low, high = planned_bounds(p, held, v, smooth, M, T)
    effort = of * (high if up else low)
    if is_covered(p, held, effort, v, smooth, M, T):
        assert low <= effort <= high


@given(st.floats(1e-6, 1e-2), speeds, speeds, st.floats(-0.9, 0.9))
def test_an_effort_well_within_the_bounds_is_covered(
    held: float, v: float, smooth: float, of: float
) -> None:
    low, high = planned_bounds(P, held, v, smooth, M, T)
    assert is_covered(P, held, of * min(-low, high), v, smooth, M, T)


@pytest.mark.parametrize("place", range(4))
def test_nothing_that_is_not_a_number_is_covered(place: int) -> None:
    numbers = [1e-3, 0.0, 0.1, 0.1]
    assert is_covered(P, numbers[0], numbers[1], numbers[2], numbers[3], M, T)
    numbers[place] = math.nan
    assert not is_covered(P, numbers[0], numbers[1], numbers[2], numbers[3], M, T)


def test_a_held_force_does_not_follow_the_noise_of_a_velocity() -> None:
    """It is a third of what the funds could give at rest, and that is twenty times as noisy."""
    held, noise = 1e-4, 0.2
    still = planned_bounds(P, held, 0.0, 0.0, M, T)[1]
    noisy = planned_bounds(P, held, -noise, -noise * T / 0.01, M, T)[1]
    assert still == pytest.approx(math.sqrt(0.1 * held / (M * T)))
    assert noisy > 0.85 * still
    whole = gate_bounds(P, held, 0.0, M, T)[1]
    assert gate_bounds(P, held, -noise, M, T)[1] < 0.8 * whole


@given(st.floats(1e-9, 1.0), speeds)
def test_the_bound_on_what_gives_is_all_that_the_funds_allow(
    held: float, free_velocity: float
) -> None:
    """Towards the motion a hair more than the bound would plan to give more than there is."""
    low, high = gate_bounds(P, held, free_velocity, M, T)
    bound = low if free_velocity > 0.0 else high
    assert planned_gift(1.0001 * bound, free_velocity) > held
    assert planned_gift(bound, free_velocity) == pytest.approx(held, rel=1e-6, abs=1e-12)


@given(speeds)
def test_without_funds_it_damps_and_nothing_else(free_velocity: float) -> None:
    bounds = gate_bounds(P, -1.0, free_velocity, M, T)
    assert min(bounds, key=abs) == 0.0
    assert max(bounds, key=abs) == pytest.approx(P.edge * free_velocity)


@given(
    st.lists(st.floats(0.0, 1e-2), min_size=1, max_size=30),
    st.lists(st.integers(0, 29), max_size=80),
)
def test_whatever_becomes_of_messages_credit_taken_is_never_more_than_sent(
    incomes: list[float], arrivals: list[int]
) -> None:
    """Lost, late, doubled and overtaking ones; the last one that arrives brings all it can."""
    tank, sent, messages = P.reserve, 0.0, []
    for income in incomes:
        tank, _ = close_account(P, tank, income)
        due = credit_due(P, tank, 0.5)
        tank, sent = tank - due, sent + due
        messages.append(sent)
    known = taken = 0.0
    for at in (it for it in arrivals if it < len(messages)):
        new = credit_received(messages[at], known)
        if new > 0.0:
            known = messages[at]
        taken += new
        assert taken <= messages[-1] * (1.0 + 1e-12)
    taken += credit_received(messages[-1], known)
    assert taken == pytest.approx(messages[-1])


def test_only_what_stands_above_the_mark_is_sent() -> None:
    assert credit_due(P, P.mark, 1.0) == 0.0
    assert credit_due(P, P.mark + 1e-3, 2.0) == pytest.approx(2e-4)
    assert credit_due(P, P.least, 0.0) == 0.0
    assert credit_due(P, P.mark, 0.0) == pytest.approx(0.2 * (P.mark - P.least))


@pytest.mark.parametrize("kept", [0.0, 0.05, 0.5, 1.0])
def test_a_follower_gives_back_to_a_leader_that_has_little_and_never_to_and_fro(
    kept: float,
) -> None:
    leader = P._replace(full=8e-3, mark=4e-3, least=1e-3)
    follower = P._replace(full=8e-3, mark=8e-3, least=kept * 8e-3, enough=0.5)
    assert credit_due(follower, 6e-3, 0.5) == 0.0
    assert credit_due(follower, 6e-3, 0.0) == pytest.approx(0.2 * max(0.0, 6e-3 - kept * 8e-3))
    levels = np.linspace(0.0, 1.0, 41)
    for one in levels:
        for two in levels:
            ahead = credit_due(leader, one * leader.full, two)
            back = credit_due(follower, two * follower.full, one)
            assert min(ahead, back) < 1e-15


def test_a_full_account_spills() -> None:
    held, spilled = close_account(P, 9e-3, 3e-3)
    assert held == P.capacity
    assert spilled == pytest.approx(2e-3)


def test_a_leader_resists_with_friction_from_its_slip_on_and_a_drag_beside_it() -> None:
    p = P._replace(friction=0.05, slip=0.1, drag=0.2)
    found = [level_friction(p, v) for v in (0.0, 0.05, 0.1, 1.0, -1.0)]
    assert found == pytest.approx([0.0, 0.035, 0.07, 0.25, -0.25])
    assert level_friction(P, 3.0) == 0.0


def test_a_level_beyond_full_or_below_empty_is_none() -> None:
    assert [level_missing(level) for level in (2.0, 1.0, 0.25, 0.0, -3.0)] == [0, 0, 0.75, 1, 1]


def test_an_overdrawn_account_does_not_brake() -> None:
    assert brake_effort(P, -P.debt, 0.5) == 0.5
    assert brake_effort(P, -1.001 * P.debt, 0.5) == 0.0
    assert brake_effort(P, float("nan"), 0.5) == 0.0
