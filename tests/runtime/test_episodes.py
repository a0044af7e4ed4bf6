"""Episodes of an operated rig: where they begin and end, and who says so."""

from __future__ import annotations

from tautwave.runtime.operate.journal import Journal
from tests.runtime.operating import STILL, bench, operate


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
