"""A local model: its spring never holds more than the funds, and what it costs is its energy."""

from __future__ import annotations

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.couplings.mediated.contact import Surface
from tautwave.couplings.mediated.model import ModelParams, adopt, damping_of, push_of, stored_in

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
