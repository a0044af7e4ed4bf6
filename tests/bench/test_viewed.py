"""`tautwave bench view`: turns are distinguished; stopped and killed bridges cost no row."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.bench.live.viewed import Viewed, _by_turn, viewed, viewed_suite

pytestmark = pytest.mark.realtime


def test_turns_are_distinguished_by_time() -> None:
    time_s = np.arange(0.0, 4.0, 0.1)
    late_us = np.floor(time_s + 1e-9)  # the number of its turn
    open_us, closed_us = _by_turn(time_s, late_us, [0.0, 1.0, 2.0, 3.0])
    assert set(open_us) == {0.0, 2.0}
    assert set(closed_us) == {1.0}
    assert len(closed_us) == 7  # what was waiting is sent in the first 0.3 s


def test_goals_are_of_the_page_against_none() -> None:
    found = Viewed(np.full(9, 30.0), np.full(9, 20.0), 0.02, 40.0, 69, {"rows_dropped": 1})
    goals = {goal.name: goal for goal in viewed_suite(found).goals}
    assert goals["lateness with bridges open against stopped, p99"].measured == 1.5
    assert [goal.met for goal in goals.values()] == [False, True, False, True, True]


@pytest.mark.nightly
@pytest.mark.slow
def test_stopped_and_killed_bridges_cost_no_row() -> None:
    found = viewed(turns=4, turn_s=0.5)
    assert set(found.bridges) >= {"page", "foxglove", "camera"}
    assert found.alive > 50, "the run goes on when they are killed"
    assert found.missing == 0
    assert found.recording["rows_dropped"] == 0
    assert found.recording["rows_written"] == found.recording["rows_offered"]
    assert found.recording["error"] is None
    assert len(found.open_us) > 50
    assert len(found.closed_us) > 50
