"""`python -m tests.lab chosen`: what is said to be measured is."""

from __future__ import annotations

import pytest

from tests.lab.couplings.chosen import (
    AUTO,
    CURVE,
    TUNED,
    chosen,
    chosen_on,
    group,
    held_runs,
    held_tables,
    splits,
)
from tests.lab.couplings.frontier import Score
from tests.lab.port.hands import Hand, synthetic_hands


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

    scores = {CURVE[0]: (0.2, 3.0), CURVE[1]: (0.3, 2.0), CURVE[2]: (0.4, 1.0)}
    found = {it: {"foam": [score(*pair)]} for it, pair in scores.items()}
    assert chosen_on(found, CURVE[:3], {"m1_a"}) == CURVE[1]


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
    found = held_runs(hands, (AUTO, TUNED[0]), (0.02,), "python", lambda _: None)
    for scores in found[0.02].values():
        assert all(0.0 < it.error < it.task < 2.0 for it in scores)
        assert all(0.1 < it.over_lab < 10.0 for it in scores)
    whole, by_splits = held_tables(hands, found)
    assert [row[1] for row in whole.rows] == [AUTO.name, TUNED[0].name]
    [row] = by_splits.rows
    assert row[4] <= row[5]
