"""A local model: its spring never holds more than the funds, and what it costs is its energy."""

from __future__ import annotations

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import CoupledAxis
from tautwave.couplings.mediated.estimate import Surface
from tautwave.couplings.mediated.keys import MediatedPair
from tautwave.couplings.mediated.law import (
    ModelParams,
    SignalParams,
    adopt,
    damping_of,
    end_constants,
    push_of,
    stored_in,
)
from tautwave.errors import ConfigError

P = ModelParams(share=0.02, span=1e-3, most=0.1)
some = st.floats(0.0, 500.0)
place = st.floats(-0.3, 0.3)
side = st.sampled_from((1.0, -1.0))


@given(some, place, some, place, place, side, st.floats(1.0, 20.0), st.floats(-0.1, 1.0))
def test_what_a_surface_holds_is_covered_and_what_it_costs_is_what_it_holds_more(
    stiffness: float, at: float, known: float, where: float, x: float, side: float, periods: float,
    funds: float,
) -> None:  # fmt: skip
    s = Surface(stiffness, 0.0, at)
    before = stored_in(s, side, x)
    cost = adopt(P, s, Surface(known, 0.0, where), side, x, periods, funds)
    after = stored_in(s, side, x)
    assert after <= max(funds, 0.0) * (1.0 + 1e-12)
    assert cost == pytest.approx(after - before, abs=1e-15)
    assert 0.0 <= s.stiffness <= max(stiffness, known)


@given(some, place, place, side)
def test_out_of_touch_it_becomes_what_is_known_at_once_and_free(
    known: float, where: float, x: float, side: float
) -> None:
    s = Surface()
    cost = adopt(P, s, Surface(known, 0.0, where), side, x, 1.0, 0.0)
    if side * (x - where) <= 0.0:
        assert (s.stiffness, s.position) == (known, where)
    assert cost == 0.0


@given(some, place, place, st.floats(-5.0, 5.0), side)
def test_it_never_pulls_and_is_damped_as_its_spring_needs(
    stiffness: float, at: float, x: float, v: float, side: float
) -> None:
    s = Surface(stiffness, 0.02, at)
    push = push_of(P, s, side, x, v)
    assert side * push >= 0.0
    if side * (x - at) <= 0.0:
        assert push == 0.0
    assert damping_of(P, s) == min(0.1, max(0.02, 1e-3 * stiffness))


def pump(funds: float, *, ruled: bool) -> float:
    """Energy that an adversary takes who stiffens a pressed spring and softens it to go in [J]."""
    s, taken, depth = Surface(500.0, 0.0, 0.0), 0.0, 1e-9
    draw = random.Random(1)
    p = ModelParams(share=1.0, span=0.0, most=0.0)
    for _ in range(20):
        for stiffness, to in ((500.0, 0.03), (1000.0, 1e-9)):
            covered = funds - taken if ruled else 1e9
            adopt(p, s, Surface(stiffness, 0.0, 0.0), 1.0, depth, 1.0, covered)
            before = stored_in(s, 1.0, depth)
            depth = to * draw.uniform(0.9, 1.0)
            taken -= stored_in(s, 1.0, depth) - before
    return taken


def test_who_stiffens_it_when_pressed_takes_no_more_than_the_funds() -> None:
    """reference: 20 cycles of 500 and 1,000 N/m; without the rule 4 J for 6.25 mJ."""
    assert pump(6.25e-3, ruled=False) > 2.0
    assert pump(6.25e-3, ruled=True) <= 6.25e-3 + 1e-12


PAIR = MediatedPair.model_validate(
    {"stiffness": 20.0, "damping": 0.5, "force_gain": 0.8, "observer_hz": 80.0, "touch": 0.03,
     "memory_s": 0.5, "sure": 0.3, "stiffest": 40.0, "adopt_s": 0.05, "position_scale": 2.0,
     "force_scale": 3.0, "sign": -1}
)  # fmt: skip
AXIS = CoupledAxis(
    1e-3, 1.0, 1e-3, 1e-5, 2e-5, 2, 0.0, mass=2e-3, viscous=3e-3, coulomb=0.01, senses=True
)


@pytest.mark.parametrize(("late", "periods"), [(0.0, 2.5), (0.4, 3.5)])
@pytest.mark.parametrize(("side", "scale"), [("master", 1.0), ("slave", 1.5)])
def test_the_constants_of_an_end_are_those_of_its_keys_in_its_own_units(
    side: str, scale: float, late: float, periods: float
) -> None:
    """A spring of the pair is times 3 / 2 at the slave; a part of a period is late by all of it."""
    follows = side == "slave"
    end = end_constants(PAIR, side, AXIS._replace(late=late))
    assert (end.follows, end.measures) == (follows, False)
    assert (end.stiffness, end.damping) == ((30.0, 0.75) if follows else (0.0, 0.0))
    assert end.force == (0.8 if follows else 0.0)
    assert (end.read_stiffness, end.read_damping) == (2.0, -4.0 / 3.0)
    assert end.stiffest == 40.0 * scale
    pole = math.exp(-0.16 * math.pi)
    assert end.signals == SignalParams(pytest.approx(pole), 500.0)
    outside = end.outside
    assert (outside.mass, outside.viscous, outside.coulomb) == (2e-3, 3e-3, 0.01)
    assert outside.soft == pytest.approx((1.0 - pole) * 0.02)  # the noise of a period's difference
    assert end.contact.fit.forget == pytest.approx(math.exp(-13e-3 / 0.5))  # 5 / (1 - p) = 12.7
    assert (end.contact.every, end.contact.touch, end.contact.sure) == (13, 0.03, 0.3)
    if not follows:  # the one that renders
        assert end.model.share == pytest.approx(1.0 - math.exp(-0.02))
        assert end.model.span == pytest.approx(2e-3 * periods)
        assert end.model.most == pytest.approx(2e-3 * periods * 40.0)


def test_an_effort_is_measured_at_a_slave_with_a_sensor_or_not_at_all() -> None:
    pair = PAIR.model_copy(update={"effort": "measured"})
    assert end_constants(pair, "slave", AXIS).measures
    bare = AXIS._replace(senses=False)
    assert not end_constants(pair, "master", bare).measures
    with pytest.raises(ConfigError) as refused:
        end_constants(pair, "slave", bare)
    assert str(refused.value) == (
        "effort: measured: the slave has no effort_sensor; add one, or use effort: observed"
    )
