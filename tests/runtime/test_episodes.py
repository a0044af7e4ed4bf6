"""Episodes of an operated rig: where they begin and end, and who says so."""

from __future__ import annotations

import itertools

import pytest

from tautwave.errors import ConfigError
from tautwave.runtime.operate.journal import Journal
from tests.runtime.operating import STILL, Operated, bench, operate


def test_episodes_are_marked_and_the_last_one_ends_with_the_run() -> None:
    journal = Journal()
    assert journal.mark(1.0, "pick the red one") == "episode 1 started"
    assert journal.running == 1
    assert journal.mark(2.0, "failed") == "episode 1 ended"
    journal.mark(3.0, "")
    one, two = journal.summary(5.0)["episodes"]
    assert (one["name"], one["task"], one["success"]) == ("pick", "the red one", False)
    assert (two["name"], two["end_s"], two["success"]) == ("episode-2", 5.0, None)


def test_who_presses_the_same_button_as_another_undoes_nothing() -> None:
    script = "0 engage\n0.5 episode success\n0.6 episode pick\n0.7 episode pick\n0.8 hold\n"
    script += "0.9 episode failed\n0.91 episode failed\n0.95 scale 0.5\n"
    done = operate(bench(STILL), script, 1.1)
    (episode,) = done.control.journal.episodes
    assert (episode.name, episode.begin_s, episode.end_s, episode.success) == (
        "pick", 0.6, 0.9, False
    )  # fmt: skip
    assert [one.text for one in done.control.journal.entries if one.refused] == [
        "episode success: no episode is running",
        "episode 1 is running; end it first, with success or failed",
        "episode failed: no episode is running",
        "scale: this rig has no other scales; list them in operate.scales",
    ]


def test_no_episode_begins_where_the_slave_does_not_follow() -> None:
    """In idle, aligning, clutched and holding, by any key or button; one that runs may end."""
    script = "0 episode\n0.1 engage\n0.11 episode\n0.6 clutch\n0.7 episode a\n0.8 engage\n"
    script += "1.3 episode b\n1.4 hold\n1.5 episode\n1.6 episode"
    done = operate(bench(STILL), script, 1.7)
    (episode,) = done.control.journal.episodes
    assert (episode.name, episode.end_s) == ("b", 1.5)
    assert [one.text for one in done.control.journal.entries if one.refused] == [
        f"episode: the rig is {state}, so the slave does not follow; engage it first"
        for state in ("idle", "aligning", "clutched", "holding")
    ]


# -- recorded again, and by a plan -------------------------------------------------------------


def test_again_discards_the_one_that_runs_or_the_last_and_only_once() -> None:
    script = "0 again\n0 engage\n0.5 episode a\n0.6 again\n0.65 again\n0.7 episode b\n"
    script += "0.8 success\n0.85 again\n0.9 episode c\n1.0 failed\n"
    done = operate(bench(STILL), script, 1.1)
    assert [
        (one.name, one.end_s, one.success, one.discarded)
        for one in done.control.journal.episodes
    ] == [("a", 0.6, None, True), ("b", 0.8, True, True), ("c", 1.0, False, False)]  # fmt: skip
    refused = [one for one in done.control.journal.entries if one.refused]
    assert [one.at_s for one in refused] == [0.0, 0.65]
    assert {one.text for one in refused} == {"episode again: there is none to record again"}
    assert set(done.columns["operation.episode"]) == {0.0, 1.0, 2.0, 3.0}


PLAN = "operate.episodes={count: 3, episode_s: 0.3, reset_s: 0.2, name: pick}"
TASK = "operate.task=' the red   one'"


def planned(script: str, duration_s: float = 6.0) -> Operated:
    return operate(bench(STILL, PLAN, TASK), script, duration_s)


def test_a_plan_records_its_episodes_and_ends_the_run() -> None:
    done = planned("0.1 engage")
    episodes = done.control.journal.episodes
    engaged = next(one for one in done.control.journal.entries if one.state == "engaged").at_s
    assert len(episodes) == 3
    assert {(one.name, one.task) for one in episodes} == {("pick", "the red one")}
    assert episodes[0].begin_s == pytest.approx(engaged, abs=0.011)
    for one, following in itertools.pairwise(episodes):
        assert one.end_s is not None
        assert one.end_s - one.begin_s == pytest.approx(0.3, abs=0.011)
        assert following.begin_s - one.end_s == pytest.approx(0.2, abs=0.011)
    assert done.result.error is None
    assert done.columns["time_s"][-1] < 3.0  # it did not go on to its 6 s


def test_people_end_an_episode_of_a_plan_begin_the_next_and_have_one_again() -> None:
    """What is recorded again does not count; a rig that holds begins nothing."""
    script = "0.1 engage\n0.55 success\n0.6 episode now\n0.65 failed\n0.7 again\n1.2 hold\n"
    done = planned(script + "2.5 engage")
    first, second, *others = episodes = done.control.journal.episodes
    assert (first.end_s, first.success) == (0.55, True)
    assert (second.name, second.discarded, second.task) == ("now", True, "the red one")
    assert sum(not one.discarded for one in episodes) == 3
    assert len(others) == 2
    assert not any(1.2 < one.begin_s < 2.5 for one in others)


def test_a_plan_begins_nothing_until_someone_engages() -> None:
    assert not planned("5.0 stop", 1.0).control.journal.episodes


def test_an_episode_of_a_plan_is_not_named_as_an_ending() -> None:
    with pytest.raises(ConfigError, match="ends an episode; choose another name"):
        bench("operate.episodes={count: 1, episode_s: 1, name: again}")
