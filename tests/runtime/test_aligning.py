"""How long an alignment may take, and which pairs it brings into place; none out of range."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave.controller.records import AxisState
from tautwave.laws.rest.alignment import AlignParams
from tautwave.runtime.operate.rest.aligning import MAX_WAYS, PATIENCE_S, Alignment
from tautwave.runtime.operate.rest.pull import PullParams
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
        pairs.append(
            SimpleNamespace(
                master=2 * at, slave=2 * at + 1, ratio=2.0, offset=0.1, tolerance=2.0 * reach
            )
        )
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


def test_a_second_way_has_a_budget_beside_what_the_first_one_took() -> None:
    made = alignment(0.5)
    made.begin(0, keep_offset=False)
    made.start(0)
    first, slave = made.granted, made._axes[1]
    assert made.pulls[0].budget == pytest.approx(first)
    slave.position, slave.port_energy = made.pulls[0].target, -0.2
    made.pulls[0].reference = slave.position
    made._axes[0].position += 0.1
    assert not made.arrived(500)
    assert not made.arrived(1000)
    assert made.pulls[0].target == pytest.approx(0.7)
    assert made.pulls[0].budget == pytest.approx(0.2 + made.granted - first)


@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("stands", [True, False])
def test_it_has_arrived_once_slaves_are_there_and_everything_stands(
    there: bool, stands: bool
) -> None:
    made = alignment(0.015, reach=0.01)  # as near as pairs engage, and not yet where it is sent
    made.begin(0, keep_offset=False)
    made.start(0)
    if there:
        made._axes[1].position = made.pulls[0].reference = made.pulls[0].target
    found = []
    for slot in range(100, 600, 100):
        made._axes[1].position += 0.0 if stands else 0.008 * (-1.0) ** (slot // 100)
        found.append(made.arrived(slot))
    assert found[-1] == (there and stands)
    assert any(found) == (there and stands)


def test_a_master_that_never_stays_is_followed_so_many_times_and_then_blocks() -> None:
    made = alignment(0.5)
    made.begin(0, keep_offset=False)
    made.start(0)
    first, slot = made.granted, 0
    while not made.is_late(slot) and slot < 100_000:
        made._axes[1].position = made.pulls[0].reference = made.pulls[0].target
        made._axes[0].position += 0.1
        for _ in range(2):  # it stands, and stood half a second before
            slot += 500
            assert not made.arrived(slot)
    assert slot < 10_000
    assert first < made.granted <= MAX_WAYS * first
    unused: Any = [None, None]
    why = made.hindrance(["a"], unused, unused)
    assert why == "an axis moves, or is in its wall; keep the devices still to engage"
    made.begin(slot, keep_offset=False)  # asked again: the ways count anew
    made.start(slot)
    assert not made.is_late(slot)


def test_none_is_pulled_while_one_has_a_place_outside_its_range() -> None:
    made = alignment(0.5, 0.5, 0.5)  # the third one's place is 4.5
    made.begin(0, keep_offset=False)
    made.start(0)
    assert made.pulls == {}
    assert made.granted == 0.0
    assert made.is_late(0)
    why = made.hindrance(["a", "b", "c"], [], [])
    assert why == "c not aligned: its target, 4.5, is outside its position_range"
    made.begin(50, keep_offset=True)
    made.start(50)
    assert not made.is_late(51)


def engaged_by(*keys: str, script: str = "0.1 engage", duration_s: float = 1.5) -> Any:
    """Return a run, and how far from its place the slave is when the pair engages."""
    pair = "coupling.pairs.lever"
    place = (f"{pair}.offset=0.1", f"{pair}.engage_tolerance=0.01")
    done = operate(bench(FREE, *BARE, *place, *keys), script, duration_s)
    (q,) = done.control.pairs
    at = int(np.argmax(done.columns["operation.engagement"]))
    one, two = (done.columns[f"{side}.lever.position"][at] for side in ("master", "slave"))
    return done, abs(q.ratio * one + q.offset - two), q.tolerance


def test_a_master_that_moves_meanwhile_is_followed_before_they_engage() -> None:
    """It used to engage where the master had been: the coupling made up for it, at 0.9 rad/s."""
    way = "waypoints: [[0, 0], [0.15, 0], [0.4, 0.15], [9, 0.15]]"
    done, gap, tolerance = engaged_by(
        f"simulation.hand.lever.reference={{type: minimum_jerk, {way}}}", "operate.align_speed=1",
        "operate.align_acceleration=9",
    )  # fmt: skip
    assert done.words() == [("engage", "aligning"), ("aligned", "engaged")]
    assert gap < tolerance
    given = -done.columns["lever.operate.absorbed"]
    assert 0.0 < given.max() < done.control.alignment.granted
    assert np.abs(done.residual()).max() <= 1e-12


def test_at_another_scale_they_engage_as_near_as_that_wants() -> None:
    done, gap, tolerance = engaged_by(
        STILL, "coupling.pairs.lever.offset=0.03", "operate.scales=[0.1]",
        script="0.05 scale 0.1\n0.1 engage", duration_s=0.6,
    )  # fmt: skip
    assert done.words()[-1] == ("aligned", "engaged")
    assert tolerance == pytest.approx(1e-3)
    assert gap < tolerance


def test_a_slave_that_moves_once_everything_let_go_is_not_engaged() -> None:
    made = alignment(0.0, reach=0.01)
    made.begin(0, keep_offset=False)
    made.start(0)
    made.let_go = 5
    unused: Any = [None]
    for moved, is_gone in ((0.019, False), (0.021, True)):  # it engages at twice the reach
        made._axes[1].position = 2.0 * made._axes[0].position + 0.1 - moved
        assert made.is_late(6) == is_gone
    why = made.hindrance(["lever"], unused, unused)
    assert why == "lever not aligned: it moved while everything was released"


def test_a_run_holds_where_a_slave_cannot_follow() -> None:
    pair = "coupling.pairs.lever"
    keys = (f"{pair}.offset=0.2", f"{pair}.engage_tolerance=0.01")
    narrow = "slave.axes.lever.position_range=[-0.15,1.2]"
    done = operate(bench(STILL, FREE, *BARE, *keys, narrow), "0.1 engage", 0.5)
    assert done.words() == [("engage", "aligning"), ("blocked", "holding")]
    text = done.control.journal.entries[-1].text
    assert "lever not aligned: its target, -0.2, is outside its position_range" in text
    assert np.abs(done.columns["slave.lever.position"]).max() < 1e-3  # it stayed
