"""The ramp of a stop under a host that stalls: it ends on time, and within the claim."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.analysis.claim import Claim
from tautwave.controller.axis import decide_axis
from tests.runtime.parts import WIDE, Axis, T, site

EFFORT, MASS, FASTEST = 1.125, 1.1e-3, 15.0
MISSING, STALL = 5, 40
"""`missing_limit` and `overrun_limit`."""


def pushing(rate: float) -> Axis:
    """Return an axis whose motor pushes at its limit, and whose tank is overdrawn."""
    limit = WIDE._replace(effort=EFFORT, effort_step=rate * T, stop_damping=1e-3)
    axis = site(mass=MASS, limit=limit, reserve=1e-3)
    axis.state.total = axis.state.port_effort = -EFFORT
    axis.state.end.account = -1.0
    return axis


def decide(axis: Axis, valid: bool) -> float:
    """Let an axis decide; return what its motor pushes with [N m]."""
    decide_axis(axis.state, axis.params, axis.table, valid, 1.0, axis.law.steps)
    return -axis.total


def given_out(rate: float, missed: int, stalls: list[tuple[int, bool]]) -> float:
    """Return what the motor gives [J] from the last sample on that was in order.

    `missed` cycles bring no sample; the axis stops after the first stall. A stall lasts so many
    slots, and whether the next sample is valid comes with it.
    """
    axis = pushing(rate)
    x, v, work, push = 0.0, FASTEST, 0.0, EFFORT
    for slots, valid in [(1, False)] * missed + stalls:
        for _ in range(slots):
            axis.pass_slot()
            work += push * (v * T + 0.5 * push * T * T / MASS)
            x += v * T + 0.5 * push * T * T / MASS
            v += push * T / MASS
        if (slots, valid) in stalls:
            axis.state.stopping = True
        if valid:
            axis.close(x, math.nan)
            axis.state.end.account = -1.0
        else:
            axis.miss()
        push = decide(axis, valid)
    while push > 0.0:
        axis.pass_slot()
        axis.miss()
        work += push * (v * T + 0.5 * push * T * T / MASS)
        v += push * T / MASS
        push = decide(axis, False)
    return work


def claimed(rate: float) -> float:
    return Claim(
        reserve=0.0, leak=0.0, feigned=0.0, effort=EFFORT, rate=rate, velocity=FASTEST,
        period=T, blind=MISSING + STALL, mass=MASS, deviation=0.0, peak=1.0, quantum=0.0,
        nonlinearity=0.0, stop_damping=0.0, release=0.0, kinetic=0.0,
    ).under_way  # fmt: skip


@given(
    st.sampled_from([1e3, 100.0, 10.0]),
    st.integers(0, MISSING - 1),
    st.lists(st.tuples(st.integers(1, STALL), st.booleans()), min_size=1, max_size=8),
)
@example(500.0, MISSING - 1, [(STALL, True)] * 3)
@example(500.0, MISSING - 1, [(STALL, False)] * 3)
@example(10.0, MISSING - 1, [(STALL, True), (STALL, False)] * 3)
def test_no_stalls_make_a_stop_give_more_than_was_claimed(
    rate: float, missed: int, stalls: list[tuple[int, bool]]
) -> None:
    assert given_out(rate, missed, stalls) <= claimed(rate)


def test_the_claim_is_not_much_more_than_the_worst_stalls_give() -> None:
    worst = [(STALL, True)] * 3
    assert given_out(1e3, MISSING - 1, worst) > 0.9 * claimed(1e3)


def ramp(script: list[tuple[int, bool]]) -> list[float]:
    """Return a stop's efforts [N m] after so many slots each, whether a sample came."""
    axis = pushing(100.0)
    axis.state.stopping = True
    efforts = []
    for slots, valid in script:
        for _ in range(slots):
            axis.pass_slot()
        if valid:
            axis.close(0.0, math.nan)
            axis.state.end.account = -1.0
        else:
            axis.miss()
        efforts.append(decide(axis, valid))
    return efforts


@pytest.mark.parametrize("valid", [True, False], ids=["seen", "unseen"])
def test_the_ramp_goes_by_slots_and_not_by_cycles(valid: bool) -> None:
    """100 N m/s: 11.25 slots of 1 ms from the limit to nothing, however the host stalls."""
    efforts = ramp([(1, valid), (4, valid), (1, valid), (3, valid)])
    assert efforts == pytest.approx([1.025, 0.625, 0.525, 0.225])


def test_samples_that_come_and_go_do_not_change_the_ramp() -> None:
    script = [(1, False), (1, False), (1, True), (1, False), (1, True), (1, True), (3, True)]
    efforts = ramp(script)
    assert efforts == pytest.approx([1.025, 0.925, 0.825, 0.725, 0.625, 0.525, 0.225])
