"""Alignment: no faster, no harder and with no more energy than was said beforehand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.laws.rest.alignment import (
    AlignParams,
    align_budget,
    align_effort,
    align_law,
    gate_effort,
    grow_push,
    is_spent,
    lead_reference,
    move_reference,
)
from tests.examples import tried

MASS, VISCOUS, COULOMB = 1.6e-3, 3.0e-3, 2.0e-3
PERIOD = 1e-3


def params(speed: float = 0.3, acceleration: float = 1.0, effort: float = 0.2) -> AlignParams:
    return align_law(
        MASS, 0.5 * COULOMB, effort, speed, acceleration, PERIOD, delay=0.0, lag=PERIOD
    )


def moved(
    p: AlignParams,
    gap: float,
    budget: float,
    stop: float = math.inf,
    gone: int = 6000,
    coulomb: float = COULOMB,
) -> tuple[float, float, float, float]:
    """Pull a lever over a gap; return its place, top speed, top effort and the energy put in.

    Beyond `stop` [rad] stands a spring of 200 N m/rad, until the period `gone`.
    """
    position = velocity = spent = fastest = hardest = 0.0
    reference = rate = push = 0.0
    for now in range(6000):
        if now >= gone:
            stop = math.inf
        reference, rate = move_reference(p, reference, rate, gap)
        reference, rate = lead_reference(p, reference, rate, position)
        push = grow_push(p, push, reference, position)
        effort = align_effort(p, reference, rate, position, velocity, push)
        effort = gate_effort(p, effort, velocity, spent, budget)
        hardest = max(hardest, abs(effort))
        before = position
        for _ in range(20):
            step = PERIOD / 20
            drive = effort - VISCOUS * velocity - 200.0 * max(0.0, position - stop)
            held = abs(velocity) < 1e-6 and abs(drive) <= coulomb
            friction = drive if held else math.copysign(coulomb, velocity or drive)
            velocity = 0.0 if held else velocity + (drive - friction) / MASS * step
            position += velocity * step
        spent += effort * (position - before)
        fastest = max(fastest, abs(velocity))
    return position, fastest, hardest, spent


@settings(max_examples=3, deadline=None)
@given(gap=st.floats(0.05, 0.6), sign=st.sampled_from((-1.0, 1.0)))
def test_a_free_lever_arrives_within_speed_and_budget(gap: float, sign: float) -> None:
    p = params()
    budget = align_budget(p, gap, COULOMB, VISCOUS, MASS)
    position, fastest, hardest, spent = moved(p, sign * gap, budget)
    assert position == pytest.approx(sign * gap, abs=1e-3)
    assert fastest <= p.speed
    assert hardest <= p.effort
    assert 0.0 < spent <= budget


@pytest.mark.parametrize("known", [0.0, 0.5, 0.9])
def test_friction_that_is_not_known_keeps_no_lever_from_its_place(known: float) -> None:
    friction = 60.0 * COULOMB
    p = align_law(MASS, known * friction, 0.2, 0.3, 1.0, PERIOD, delay=0.0, lag=PERIOD)
    budget = align_budget(p, 0.3, friction, VISCOUS, MASS)
    position, fastest, hardest, spent = moved(p, 0.3, budget, coulomb=friction)
    assert position == pytest.approx(0.3, abs=2e-3)
    assert friction / p.stiffness > 7e-3  # of which its spring alone would fall short
    assert fastest <= p.speed
    assert hardest <= p.effort
    assert spent <= budget


def test_an_obstacle_gets_the_greatest_effort_and_no_more() -> None:
    p = params(effort=0.05)
    budget = align_budget(p, 0.5, COULOMB, VISCOUS, MASS)
    position, _, hardest, spent = moved(p, 0.5, budget, stop=0.1)
    assert hardest == p.effort
    assert position == pytest.approx(0.1, abs=0.002)
    assert spent <= budget


def test_a_lever_that_an_obstacle_lets_go_of_keeps_its_speed() -> None:
    p = params(effort=0.1)
    budget = align_budget(p, 0.5, COULOMB, VISCOUS, MASS)
    position, fastest, _, _ = moved(p, 0.5, budget, stop=0.1, gone=3000)
    assert position == pytest.approx(0.5, abs=1e-3)
    pressed = 0.1 / 200.0  # the spring gives back what it holds
    assert fastest <= p.speed + math.sqrt(200.0 / MASS) * pressed


def test_a_budget_that_is_too_small_ends_the_push() -> None:
    p = params()
    position, _, _, spent = moved(p, 0.5, 1e-4)
    assert position < 0.3
    assert spent <= 1e-4


@given(
    start=st.floats(-1.0, 1.0), target=st.floats(-1.0, 1.0),
    speed=st.floats(0.2, 2.0), acceleration=st.floats(0.5, 20.0),
)  # fmt: skip
@settings(max_examples=tried(20), deadline=None)
def test_the_reference_keeps_speed_and_acceleration_and_ends_at_the_target(
    start: float, target: float, speed: float, acceleration: float
) -> None:
    p = params(speed, acceleration)
    reference, rate = start, 0.0
    time_s = abs(target - start) / speed + 2.0 * speed / acceleration + 0.5
    for _ in range(round(time_s / PERIOD)):
        before = rate
        after, rate = move_reference(p, reference, rate, target)
        assert abs(rate) <= speed * (1.0 + 1e-12)
        assert abs(rate - before) <= acceleration * PERIOD * (1.0 + 1e-9)
        assert (target - after) * (target - start) >= -1e-9
        reference = after
    assert (reference, rate) == (target, 0.0)


def test_a_blocked_reference_does_not_wind_up() -> None:
    p = params()
    reference = rate = 0.0
    for _ in range(1000):
        reference, rate = lead_reference(p, *move_reference(p, reference, rate, 1.0), 0.0)
    assert reference == pytest.approx(p.effort / p.stiffness, rel=1e-9)
    assert align_effort(p, reference, rate, 0.0, 0.0) == p.effort
    reference, rate = lead_reference(p, -1.0, -0.3, 0.0)
    assert (reference, rate) == (-p.effort / p.stiffness, 0.0)


def test_at_the_end_of_the_budget_only_braking_is_left() -> None:
    p = params()
    for spent, pushes, brakes in ((-2.1, True, True), (-1.9, False, True), (-0.9, False, False)):
        assert is_spent(p, spent * p.reserve, 0.0) is not pushes
        assert gate_effort(p, 0.1, 0.2, spent * p.reserve, 0.0) == (0.1 if pushes else 0.0)
        assert gate_effort(p, 0.1, 0.0, spent * p.reserve, 0.0) == (0.1 if pushes else 0.0)
        assert gate_effort(p, -0.1, 0.2, spent * p.reserve, 0.0) == (-0.1 if brakes else 0.0)
    assert gate_effort(p, -0.1, 0.2, math.nan, 1.0) == 0.0


def test_the_budget_has_the_way_twice_and_what_two_commands_may_give_unseen() -> None:
    p = align_law(
        MASS,
        0.0,
        0.05,
        0.3,
        1.0,
        PERIOD,
        delay=3e-3,
        lag=4e-3,
        rate=50.0,
        fastest=2.0,
        stalled=0.02,
    )
    assert p.effort == pytest.approx(0.3 * MASS / 12e-3)
    held = 2e-3 + 3e-3 + 0.02 + 0.5 * p.effort / 50.0
    assert p.reserve == pytest.approx(p.effort * (2.0 * held + 0.5 * p.effort * held**2 / MASS))
    way = (COULOMB + VISCOUS * 0.3) * 0.5 + 0.5 * 2.0 * MASS * 0.3**2
    for gap in (0.5, -0.5):
        budget = align_budget(p, gap, COULOMB, VISCOUS, 2.0 * MASS)
        assert budget == pytest.approx(2.0 * way + 2.0 * p.reserve)


def test_known_friction_is_pushed_against_at_once_and_unknown_friction_by_a_push_that_grows() -> (
    None
):
    p = params()
    small = 0.05 * p.friction / p.stiffness
    for way in (1.0, -1.0):
        asked = align_effort(p, way * small, 0.0, 0.0, 0.0)
        assert asked == pytest.approx(way * 0.55 * p.friction)  # the spring's twentieth, and half
        push = 0.0
        for _ in range(400):
            push = grow_push(p, push, way * 0.01, 0.0)
        assert push == way * p.effort  # and no more
        assert align_effort(p, way * small, 0.0, 0.0, 0.0, push) == way * p.effort
        assert grow_push(p, push, 0.0, 0.0) == push
        assert grow_push(p, push, 0.0, way * 1e-6) == 0.0  # it has passed


def test_a_device_that_is_too_fast_is_braked_with_no_more_than_the_effort() -> None:
    p = params()
    for way in (1.0, -1.0):
        assert align_effort(p, way, 0.0, 0.0, way * 50.0) == -way * p.effort
        at_speed = align_effort(p, way, way * p.speed, 0.0, way * p.speed)
        assert at_speed == pytest.approx(way * p.friction)
        assert align_effort(p, way * math.inf, 0.0, 0.0, 0.0) == way * p.effort
    assert align_effort(p, math.nan, 0.0, 0.0, 0.0) == 0.0
    assert align_effort(p, 1.0, 0.0, 0.0, math.nan) == 0.0


@pytest.mark.parametrize("stiffness", [4.0e3, 1.0e4])
def test_a_device_that_swings_as_fast_as_the_law_is_late_gets_no_more_than_the_budget(
    stiffness: float,
) -> None:
    """Brakes that come half a swing late push: braking without an end put in a joule a second."""
    fastest = 2.0
    p = align_law(MASS, 0.0, 0.2, 0.3, 1.0, PERIOD, delay=0.0, lag=PERIOD, fastest=fastest)
    budget = align_budget(p, 0.3, 0.0, VISCOUS, MASS)
    position = velocity = measured = spent = most = 0.0
    for _ in range(4000):
        if abs(measured) > fastest:
            break  # the guard
        before = position
        effort = align_effort(p, 0.3, 0.0, position, measured)
        effort = gate_effort(p, effort, measured, spent, budget)
        for _ in range(20):
            step = PERIOD / 20
            velocity += (effort - stiffness * position) / MASS * step
            position += velocity * step
        measured = (position - before) / PERIOD
        spent += effort * (position - before)
        most = max(most, spent)
    assert 0.5 * budget < most <= budget


@pytest.mark.parametrize("rate", [0.05, 2.0, 700.0])
def test_a_lever_that_is_let_go_of_keeps_its_speed_however_slowly_efforts_change(
    rate: float,
) -> None:
    p = align_law(MASS, 0.0, 0.2, 0.3, 1.0, PERIOD, delay=0.0, lag=PERIOD, rate=rate)
    reference = last = push = speed = position = velocity = fastest = 0.0
    for now in range(9000):
        reference, speed = move_reference(p, reference, speed, 0.3)
        reference, speed = lead_reference(p, reference, speed, position)
        push = grow_push(p, push, reference, position)
        effort = align_effort(p, reference, speed, position, velocity, push)
        last += max(-rate * PERIOD, min(rate * PERIOD, effort - last))
        if now < 3000 and position > 0.05:  # something in its way
            velocity = 0.0
            continue
        velocity += (last - VISCOUS * velocity) / MASS * PERIOD
        position += velocity * PERIOD
        fastest = max(fastest, abs(velocity))
    assert fastest <= 1.001 * p.speed
    assert position == pytest.approx(0.3, abs=5e-3)
