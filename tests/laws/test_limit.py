"""Limits: never exceeded, whatever comes in; shares add up; guards name what is wrong."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.limit import (
    AT_LIMIT,
    NO_LIMITS,
    RAMPED,
    RATE_LIMITED,
    STEPPED,
    LimitParams,
    clamp,
    guard_axis,
    limit_effort,
    limited_by,
    share_effort,
    stop_effort,
)

INF = math.inf
anything = st.floats(allow_nan=True, allow_infinity=True)
bounds = st.floats(0.0, 1e6)
numbers = st.floats(-1e6, 1e6)


def limits(effort: float = 1.0, step: float = INF, quantum: float = 0.0) -> LimitParams:
    return LimitParams(effort, step, quantum, 10.0, -1.0, 1.0, 0.5)


@given(anything, bounds)
@example(math.nan, 1.0)
@example(-0.0, 0.0)
@example(INF, 2.0)
@example(-INF, 2.0)
def test_clamp_is_within_its_bound_for_any_float(value: float, bound: float) -> None:
    out = clamp(value, bound)
    assert -bound <= out <= bound
    if math.isnan(value):
        assert out == 0.0
    if abs(value) <= bound:
        assert out == value


@given(
    anything,
    st.floats(1e-6, 1e6),
    st.one_of(st.just(INF), st.floats(0.0, 1e6)),
    st.one_of(st.just(0.0), st.floats(1e-300, 1e6)),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 2.0),
)
@example(math.nan, 1.0, INF, 0.0, 0.0, 1.0)
@example(math.nan, 1.0, 0.1, 0.25, 0.5, 1.0)
@example(INF, 0.9999999999, INF, 1.0, 0.0, 2.0)
@example(-INF, 0.9999999999, INF, 1.0, 0.0, 2.0)
@example(-0.0, 1.0, INF, 0.1, 0.0, 1.0)
@example(1.0, 1.0, INF, 5e-324, 0.0, 2.0)
@example(0.3, 1.0, INF, 0.1, 0.0, 2.0)
def test_effort_limits_hold_for_any_float(
    asked: float, effort: float, step: float, quantum: float, last_share: float, ceiling: float
) -> None:
    p = limits(effort, step, quantum)
    last = last_share * effort
    out = limit_effort(p, asked, last, ceiling)
    assert math.isfinite(out)
    assert abs(out) <= effort
    # The ceiling of a ramp may only be passed because the rate limit does not let it down faster.
    assert abs(out) <= max(ceiling, abs(last) - step)
    if math.isfinite(step):  # truncation may add a part of a quantum, towards zero
        slack = 1e-15 * (abs(last) + step)
        assert abs(out - last) <= step + quantum + slack
    if quantum > 0.0 and abs(out) / quantum < 1e15:
        # It is a multiple, and sending it again changes nothing.
        assert round(out / quantum) * quantum == pytest.approx(out, rel=1e-12, abs=0.0)
        assert limit_effort(limits(effort, INF, quantum), out, out, INF) == out


@given(numbers, st.floats(1e-6, 1e3))
def test_truncation_never_enlarges_and_loses_less_than_a_quantum(
    value: float, quantum: float
) -> None:
    out = limit_effort(limits(INF, INF, quantum), value, 0.0, INF)
    assert abs(out) <= abs(value)
    assert abs(value) - abs(out) < quantum * (1.0 + 1e-9)
    assert out * value >= 0.0


@given(
    numbers,
    st.floats(1e-3, 1e6),
    st.one_of(st.just(INF), st.floats(1e-3, 1e6)),
    st.one_of(st.just(0.0), st.floats(1e-3, 1e6)),
    st.floats(-1.0, 1.0),
    st.floats(0.0, 2.0),
)
def test_each_limit_that_is_met_has_its_bit(
    asked: float, effort: float, step: float, quantum: float, last_share: float, ceiling: float
) -> None:
    p, last = limits(effort, step, quantum), last_share * effort
    ceiling *= effort
    found = limited_by(p, asked, last, ceiling)
    if found == 0:
        assert limit_effort(p, asked, last, ceiling) == asked
    assert bool(found & AT_LIMIT) == (abs(asked) >= effort)
    assert bool(found & RAMPED) == (ceiling < min(abs(asked), effort))
    bound = min(effort, ceiling)
    away = abs(max(-bound, min(bound, asked)) - last)
    assert bool(found & RATE_LIMITED) == (away > step) or math.isclose(away, step)
    assert not found & STEPPED or quantum > 0.0


def test_rate_limit_walks_to_the_target_and_stays() -> None:
    p, last, seen = limits(10.0, 0.3), 0.0, []
    for _ in range(5):
        last = limit_effort(p, 1.0, last, 10.0)
        seen.append(last)
    assert seen == pytest.approx([0.3, 0.6, 0.9, 1.0, 1.0])


@given(numbers, numbers, numbers)
def test_shares_add_up_and_the_wall_never_pulls(wall: float, port: float, applied: float) -> None:
    share = share_effort(wall, port, applied)
    rest = applied - share
    scale = abs(wall) + abs(port) + abs(applied)
    slack = 1e-12 * scale
    if wall == 0.0:
        assert share == applied
        return
    side = math.copysign(1.0, wall)
    assert -slack <= side * rest <= side * wall + slack
    short = side * (applied - wall - port)
    if short >= slack:  # more than was asked for: all of it is the port's
        assert abs(rest - wall) <= slack
    elif short <= -slack:
        # Less: the port gives what it planned at most, and pushes no more than it asked.
        if side * applied >= min(0.0, side * port):
            assert min(0.0, side * port) - slack <= side * share <= max(0.0, side * port) + slack
        # As long as the port can pay, the wall is whole.
        if side * port >= -short:
            assert abs(rest - wall) <= slack


@pytest.mark.parametrize(
    ("wall", "port", "applied", "share"),
    [
        (3.0, 2.0, 4.0, 1.0),  # the port pays
        (3.0, 2.0, 1.0, 0.0),  # and then the wall
        (3.0, -1.0, 1.0, -1.0),  # a port that pulls does not pull harder
        (3.0, -1.0, -2.0, -2.0),  # unless the motor does, which is not the wall's doing
        (3.0, 2.0, 6.0, 3.0),  # an excess is the port's
        (-3.0, -2.0, -4.0, -1.0),
        (-3.0, 1.0, -1.0, 1.0),
        (0.0, 5.0, 2.0, 2.0),
    ],
)
def test_shares_by_example(wall: float, port: float, applied: float, share: float) -> None:
    assert share_effort(wall, port, applied) == pytest.approx(share)


@pytest.mark.parametrize(
    ("wall", "port"), [(math.nan, 1.0), (1.0, math.nan), (0.0, math.nan), (math.nan, math.nan)]
)
def test_shares_of_nan_are_numbers(wall: float, port: float) -> None:
    applied = limit_effort(limits(), wall + port, 0.0, 1.0)
    share = share_effort(wall, port, applied)
    assert (applied, share, applied - share) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("position", "velocity", "code"),
    [
        (0.0, 0.0, 0), (1.0, 10.0, 0), (-1.0, -10.0, 0), (-0.0, -0.0, 0),
        (1.0000001, 0.0, 1), (-2.0, 0.0, 1), (2.0, 99.0, 1), (2.0, math.nan, 3),
        (0.0, 10.1, 2), (0.0, -1e9, 2),
        (math.nan, 0.0, 3), (0.0, math.nan, 3), (INF, 0.0, 3), (-INF, 0.0, 3), (0.0, INF, 3),
        (math.nan, math.nan, 3),
    ],
)  # fmt: skip
def test_guard_says_what_is_wrong(position: float, velocity: float, code: int) -> None:
    assert guard_axis(limits(), position, velocity) == code


@given(anything, anything)
def test_guard_lets_only_finite_values_within_limits_pass(position: float, velocity: float) -> None:
    inside = -1.0 <= position <= 1.0 and -10.0 <= velocity <= 10.0
    assert (guard_axis(limits(), position, velocity) == 0) == inside


def test_absent_limits_are_infinite() -> None:
    p = LimitParams(effort=1.0)
    assert guard_axis(p, 1e300, -1e300) == 0
    assert guard_axis(p, math.nan, 0.0) == 3
    assert guard_axis(p, 0.0, math.nan) == 3
    assert guard_axis(p, 0.0, INF) == 3


@given(numbers, numbers)
def test_without_limits_every_effort_is_sent(asked: float, last: float) -> None:
    assert limit_effort(NO_LIMITS, asked, last, INF) == asked
    assert limited_by(NO_LIMITS, asked, last, INF) == 0
    assert stop_effort(NO_LIMITS, asked) == 0.0


def test_stop_damps() -> None:
    assert stop_effort(limits(), 2.0) == 1.0
    assert stop_effort(limits(), -2.0) == -1.0
