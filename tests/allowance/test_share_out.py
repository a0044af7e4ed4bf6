"""Shares never add up to more than an axis has, whoever asks for how much."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.allowance import MAX_WALL_SHARE, Device, Spending, share_out

AMOUNT = st.floats(0.0, 1e4)
SOME = st.floats(1e-6, 1e4)
UNBOUNDED = SOME | st.just(math.inf)

DEVICES = st.builds(
    Device, period=st.floats(1e-4, 0.1), delay=AMOUNT, blind=AMOUNT, effort=SOME,
    effort_rate=UNBOUNDED, quantum=AMOUNT, damping=AMOUNT, coulomb=AMOUNT, velocity=UNBOUNDED,
    inertia=UNBOUNDED,
)  # fmt: skip
ASKED = st.builds(
    Spending, carries=st.booleans(), load_effort=AMOUNT, load_damping=AMOUNT, load_coulomb=AMOUNT,
    compensated_coulomb=AMOUNT, compensated_damping=AMOUNT, paying_coulomb=AMOUNT,
    damper_damping=AMOUNT, lent_damping=AMOUNT, load_lent=AMOUNT, lift_effort=AMOUNT,
    wall_effort=AMOUNT | st.just(math.inf),
    wall_rate=AMOUNT | st.just(math.inf), wall_damping=AMOUNT | st.just(math.inf),
    wall_controlled=st.booleans(), relies=st.booleans(), wall_limit=UNBOUNDED,
)  # fmt: skip


@given(DEVICES, ASKED)
def test_efforts_and_rates_add_up_to_what_the_motor_has(has: Device, asks: Spending) -> None:
    one = share_out(has, asks)
    efforts = one.wall_effort, one.compensation_effort, one.coupling_effort
    rates = one.wall_rate, one.compensation_rate, one.coupling_rate
    assert min(one.load_effort, one.load_rate, *efforts, *rates) >= 0.0
    assert sum(efforts) == pytest.approx(one.shared_effort, rel=1e-12, abs=1e-12 * has.effort)
    assert one.load_effort + one.shared_effort <= has.effort * (1.0 + 1e-15)
    if math.isfinite(has.effort_rate):
        assert sum(rates) == pytest.approx(one.shared_rate, rel=1e-9)
        assert one.load_rate + one.shared_rate <= has.effort_rate * (1.0 + 1e-15)
    if math.isfinite(asks.wall_limit):
        assert one.wall_effort <= asks.wall_limit
    elif asks.relies:
        assert one.wall_effort <= MAX_WALL_SHARE * one.shared_effort


@given(DEVICES, ASKED)
def test_damping_and_friction_are_spent_once(has: Device, asks: Spending) -> None:
    """What is spent and what is left is no more than there is; nothing is left of too little."""
    one = share_out(has, asks)
    spent = one.compensated_damping + one.damper_damping + one.own_load_damping + one.wall_damping
    left = one.coupling_damping
    assert left == 0.0 or spent + left == pytest.approx(has.damping)
    assert left <= one.loaded_damping <= one.free_damping + one.load_lent
    assert one.free_damping <= has.damping
    assert left <= one.brake_damping <= has.damping
    assert one.sampled_damping == one.free_damping + asks.lent_damping
    spent = one.compensated_coulomb + one.paying_coulomb + one.load_coulomb
    left = one.coupling_coulomb
    assert left == 0.0 or spent + left == pytest.approx(has.coulomb)
    assert left <= one.loaded_coulomb <= has.coulomb


def test_a_bare_axis_leaves_all_to_its_coupling() -> None:
    has = Device(1e-3, 0.0, 0.02, effort=2.0, effort_rate=500.0, damping=0.1, coulomb=0.03)
    one = share_out(has, Spending())
    assert (one.coupling_effort, one.coupling_rate) == (2.0, 500.0)
    assert (one.coupling_damping, one.brake_damping, one.coupling_coulomb) == (0.1, 0.1, 0.03)
    assert one.shared_step == one.effort_step == 0.5
    assert not one.starved


def test_at_rest_neither_wall_nor_compensation_spends_damping() -> None:
    has = Device(1e-3, 0.0, 0.02, effort=2.0, damping=0.1)
    asks = Spending(carries=True, load_damping=0.03, wall_damping=0.04, compensated_damping=0.02)
    one = share_out(has, asks)
    assert one.coupling_damping == pytest.approx(0.01)
    assert one.brake_damping == pytest.approx(0.07)


def test_a_passivity_controller_spares_the_damping_that_it_replaces() -> None:
    has = Device(1e-3, 0.0, 0.02, effort=2.0, damping=0.1)
    asks = Spending(wall_damping=0.2, wall_controlled=True)
    assert share_out(has, asks).coupling_damping == 0.1
    assert share_out(has, asks._replace(wall_controlled=False)).coupling_damping == 0.0
    assert share_out(has, asks._replace(wall_damping=0.06)).coupling_damping == pytest.approx(0.04)


def test_an_axis_starves_where_half_its_rate_is_less_than_a_step() -> None:
    has = Device(1e-3, 0.0, 0.02, effort=2.0, effort_rate=1.2, quantum=1e-3)
    assert share_out(has, Spending(carries=True)).starved
    assert not share_out(has, Spending()).starved
    assert not share_out(has._replace(effort_rate=2.0), Spending(carries=True)).starved
