"""How long an alignment may take, and which pairs it brings into place."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from tautwave.controller.records import AxisState
from tautwave.laws.alignment import AlignParams
from tautwave.runtime.operate.aligning import PATIENCE_S, Alignment
from tautwave.runtime.operate.resting import PullParams

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
    params = dict.fromkeys(range(len(gaps)), PullParams(LAW, 0.0, 0.0, 1e-3, reach))
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
    made = alignment(0.5, 0.005, -0.02)
    made.begin(0, keep_offset=False)
    made.start(0)
    assert sorted(made.pulls) == [0, 2]
    assert made.pulls[0].target == pytest.approx(0.5)
    assert made.granted == pytest.approx(sum(pull.budget for pull in made.pulls.values()))
    assert made.granted > 0.0
    made.begin(50, keep_offset=True)
    made.start(50)
    assert made.pulls == {}
    assert not made.is_late(50 + round(1e3 * PATIENCE_S))
