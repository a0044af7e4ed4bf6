"""How long an alignment may take, and which pairs it brings into place; none out of range."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave.controller.records import AxisState
from tautwave.laws.alignment import AlignParams
from tautwave.runtime.operate.aligning import PATIENCE_S, Alignment
from tautwave.runtime.operate.resting import PullParams
from tests.runtime.operating import BARE, FREE, STILL, bench, operate

PERIOD_NS = 1_000_000
LAW = AlignParams(5.0, 0.1, 0.5, 0.1, 0.2, 1e-3, 1e-4, 0.1, 0.0)
"""0.1 rad/s, reached and left with 0.2 rad/s2: half a second for both."""


def alignment(*gaps: float, reach: float = 0.01) -> Alignment:
    """Pairs whose slaves stand so far below their places, twice their masters' and 0.1 beyond."""
    axes, pairs = [], []
    for at, gap in enumerate(gaps):
        master, slave = AxisState(end=None), AxisState(end=None)
        master.position = 0.2 + at
        slave.position = 2.0 * master.position + 0.1 - gap
        axes += [master, slave]
        pairs.append(SimpleNamespace(master=2 * at, slave=2 * at + 1, ratio=2.0, offset=0.1))
    params = dict.fromkeys(range(len(gaps)), PullParams(LAW, 0.0, 0.0, 1e-3, reach, -9.0, 4.0))
    made: Any = pairs
    return Alignment(axes, made, params, [0.0] * len(axes), PERIOD_NS)


@pytest.mark.parametrize(("gaps", "way_s"), [((0.5, -0.2), 5.5), ((0.0,), 0.0), ((-1.0,), 10.5)])
def test_it_may_take_twice_the_longest_way_and_some_patience(
    gaps: tuple[float, ...], way_s: float
) -> None:
    made = alignment(*gaps)
    made.begin(100, keep_offset=False)
    made.start(100)
    last = 100 + round(1e3 * (2.0 * way_s + PATIENCE_S))
    assert not made.is_late(last)
    assert made.is_late(last + 1)
    made.start(900)  # begun already: the time goes on
    assert made.is_late(last + 1)


def test_only_what_is_out_of_place_is_pulled_and_nothing_that_keeps_its_offset() -> None:
    made = alignment(0.5, 0.005)
    made.begin(0, keep_offset=False)
    made.start(0)
    assert sorted(made.pulls) == [0]
    made = alignment(0.5, -0.02)
    made.begin(0, keep_offset=False)
    made.start(0)
    assert sorted(made.pulls) == [0, 1]
    assert made.pulls[0].target == pytest.approx(0.5)
    assert made.granted == pytest.approx(sum(pull.budget for pull in made.pulls.values()))
    assert made.granted > 0.0
    made.begin(50, keep_offset=True)
    made.start(50)
    assert made.pulls == {}
    assert not made.is_late(50 + round(1e3 * PATIENCE_S))


def test_none_is_pulled_while_one_has_a_place_outside_its_range() -> None:
    made = alignment(0.5, 0.5, 0.5)  # the third one's place is 4.5
    made.begin(0, keep_offset=False)
    made.start(0)
    assert made.pulls == {}
    assert made.granted == 0.0
    assert made.is_late(0)
    why = made.hindrance(["a", "b", "c"], [], [])
    assert why == "c not aligned: its place, 4.5, is outside of its position_range"
    made.begin(50, keep_offset=True)
    made.start(50)
    assert not made.is_late(51)


def test_a_run_holds_where_a_slave_cannot_follow() -> None:
    pair = "coupling.pairs.lever"
    keys = (f"{pair}.offset=0.2", f"{pair}.engage_tolerance=0.01")
    narrow = "slave.axes.lever.position_range=[-0.15,1.2]"
    done = operate(bench(STILL, FREE, *BARE, *keys, narrow), "0.1 engage", 0.5)
    assert done.words() == [("engage", "aligning"), ("blocked", "holding")]
    text = done.control.journal.entries[-1].text
    assert "lever not aligned: its place, -0.2, is outside of its position_range" in text
    assert np.abs(done.columns["slave.lever.position"]).max() < 1e-3  # it stayed
