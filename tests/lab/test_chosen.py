"""`python -m tests.lab chosen`: what is said to be measured is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.lab.couplings.chosen import (
    AUTO,
    CURVE,
    TUNED,
    WAVES_S,
    chosen,
    chosen_on,
    group,
    held_runs,
    held_tables,
    law_at,
    splits,
    tuned_at,
)
from tests.lab.couplings.frontier import Score
from tests.lab.couplings.ideal import LIMIT, WALL, ideal_tables, left, pressed
from tests.lab.port.hands import PERIOD, Hand, synthetic_hands
from tests.lab.port.tracking import RELEASED_S, SETTLED_S, rms


def named(*names: str) -> list[Hand]:
    hand = synthetic_hands(2.0)[0]
    return [hand._replace(name=name) for name in names]


def test_splits_are_all_ways_of_choosing_on_some_and_judging_on_the_others() -> None:
    hands = named("m1_a_foam", "m1_a_free_motion", "m1_d_rigid", "m2_a_spring")
    assert {group(hand.name) for hand in hands} == {"m1_a", "m1_d", "m2_a"}
    found = list(splits(hands))
    assert len(found) == 6
    assert all(some and others and not some & others for some, others in found)


def test_what_is_too_loud_or_worse_is_not_chosen() -> None:
    def score(share: float, loud: float) -> Score:
        return Score("m1_a_foam", 1.0, 1.0, share, loud, share, loud, False)

    found = {CURVE[0]: (0.2, 3.0), CURVE[1]: (0.3, 2.0), CURVE[2]: (0.4, 1.0)}
    scores = {it: {"foam": [score(*pair)]} for it, pair in found.items()}
    assert chosen_on(scores, CURVE[:3], {"m1_a"}) == CURVE[1]
    assert chosen_on(scores, CURVE[:3], {"m1_a"}, 1.5) == CURVE[2]


def test_auto_is_set_beside_its_own_law_tuned() -> None:
    for delay, law in {0.005: "wave", 0.02: "mediated", 0.3: "mediated"}.items():
        assert law_at(delay) == law
        families = {it.family for it in tuned_at(delay)} - {AUTO.family}
        assert families == ({"wave", "mediated"} if delay == WAVES_S else {law})


@pytest.mark.parametrize("stiffness", [8.1, 50.0, math.inf])
def test_a_spring_leaves_of_the_way_into_a_wall_what_it_does_not_press(stiffness: float) -> None:
    way = np.concatenate([np.full(2000, -0.01), np.full(4000, 0.003)])
    gap = 0.003 - pressed(way, stiffness, math.inf)[-1] / WALL
    assert gap == pytest.approx(
        0.003 * (0.0 if math.isinf(stiffness) else WALL / (WALL + stiffness))
    )
    assert pressed(way, stiffness, math.inf)[1000] == 0.0
    assert pressed(np.full(10, 0.1), math.inf, math.inf)[-1] == LIMIT


def test_a_spring_with_a_lag_presses_as_hard_later() -> None:
    way = np.full(4000, 0.003)
    late, lag = pressed(way, 50.0, 5.0), 1.0 / (math.tau * 5.0)
    assert late[-1] == pytest.approx(pressed(way, 50.0, math.inf)[-1])
    step = round(lag * WALL / (WALL + 50.0) / PERIOD)
    assert late[step - 1] == pytest.approx((1.0 - math.exp(-1.0)) * late[-1], rel=5e-3)


def test_what_springs_leave_is_set_over_what_was_recorded_and_the_laboratory() -> None:
    [hand] = named("m1_a_rigid")
    hand = hand._replace(positions=np.abs(hand.positions), recorded=hand.positions)
    [table] = ideal_tables([hand], {hand.name: 0.01})
    none = {row[0]: row for row in table.rows if row[1] == "none"}
    assert none["8.1"][2] > none["100"][2] > none["rigid"][2]
    assert none["8.1"][4] < none["100"][4]
    gap, loud = left(hand, 100.0, math.inf)
    first, last = round(SETTLED_S / PERIOD), round(RELEASED_S / PERIOD)
    assert none["100"][2] == pytest.approx(gap / rms(hand.recorded[first:-last]))
    assert none["100"][4] == pytest.approx(loud / 0.01)
    assert ideal_tables([hand._replace(recorded=None)], {})[0].rows == []


@pytest.mark.slow
def test_a_quick_round_has_auto_at_every_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    hands = synthetic_hands(1.0)[:2]
    monkeypatch.setattr("tests.lab.couplings.chosen.synthetic_hands", lambda: hands)
    suite = chosen(recordings=None, quick=True, tell=lambda _: None)
    rows = [row for row in suite.tables[0].rows if row[1] == AUTO.name]
    assert [row[0] for row in rows] == ["free", "foam"]
    assert all(0.0 < float(row[2] or 0.0) < 1.0 for row in rows)
    assert len(suite.goals) == 6


@pytest.mark.slow
def test_a_hand_with_a_grip_is_compared_with_master_and_wish() -> None:
    hands = [
        hand._replace(name=f"m{at}_a_{hand.contact}")
        for at, hand in enumerate(synthetic_hands(2.0)[::2], 1)
    ]
    tuned = TUNED["mediated"][0]
    found = held_runs(hands, {0.02: (AUTO, tuned)}, "python", lambda _: None)
    for scores in found[0.02].values():
        assert all(0.0 < it.error < it.task < 2.0 for it in scores)
        assert all(0.1 < it.over_lab < 10.0 for it in scores)
    whole, by_splits = held_tables(hands, found)
    assert [row[1] for row in whole.rows] == [AUTO.name, tuned.name]
    [row] = by_splits.rows
    assert row[4] <= row[5]
