"""Two sites of an operated rig: what people do at either is done at both."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from tautwave.errors import ConfigError, LinkError
from tautwave.runtime.operate.states import STATES
from tests.session.site_days import COUNTS, FREE, judge, of_all_sessions, random_day
from tests.session.sites import Half, Pair

Make = Callable[..., Pair]
SLOW = pytest.mark.slow
STILL = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0]]}"
AWAY = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [2, 0], [3, 0.2]]}"
PLACE = ("coupling.pairs.lever.offset=0.1", "coupling.pairs.lever.engage_tolerance=0.01")


@pytest.fixture
def pair() -> Iterator[Make]:
    with ExitStack() as stack:

        def make(*changes: str) -> Pair:
            made = Pair(FREE, *COUNTS, *changes)
            stack.callback(made.close)
            return made

        yield make


class Held:
    """A dead-man."""

    name = "pedal"

    def __init__(self) -> None:
        self.is_held = True

    def held(self) -> bool:
        return self.is_held


def both(two: Pair, state: str) -> bool:
    return two.master.state == two.slave.state == state


def engage(two: Pair, by: Half) -> None:
    by.ask("engage")
    two.run(1)
    two.until(lambda: both(two, "engaged"))
    two.run(60)


def words(half: Half) -> list[tuple[str, str, str]]:
    return [(one.word, one.source, one.state) for one in half.control.journal.entries]


def apart(two: Pair) -> float:
    return float(two.master["master.lever.position"][-1] - two.slave["slave.lever.position"][-1])


def test_commands_of_either_site_are_done_at_both_and_recorded_at_both(pair: Make) -> None:
    two = pair()
    two.run(5)
    assert both(two, "idle")
    for at, (by, other) in enumerate(((two.master, two.slave), (two.slave, two.master)), 1):
        engage(two, by)
        assert abs(apart(two)) < 0.02
        by.ask("clutch")
        two.run(1)
        assert by.state == "clutched"  # whatever the other one does
        two.run(2)
        assert other.state == "clutched"
        assert len(two.used) == at + 1  # a session is one engagement
        two.run(30)
    for half, far in ((two.master, "slave key"), (two.slave, "master key")):
        assert half.control.journal.engagements == 2
        assert not half.control.wants_reset  # no device of theirs is suspect
        assert half.residual() < 1e-9
        assert [one for one in words(half) if one[0] in ("engage", "clutch")] == [
            (word, source, state)
            for source in (("key", far) if half is two.master else (far, "key"))
            for word, state in (("engage", "aligning"), ("clutch", "clutched"))
        ]


@SLOW
def test_both_may_start_engaged(pair: Make) -> None:
    two = pair(STILL, "operate={start: engaged}")
    two.lag = lambda: 10
    two.run(60)
    assert both(two, "engaged")
    assert {one.control.journal.engagements for one in (two.master, two.slave)} == {1}


@SLOW
def test_a_pair_that_starts_out_of_place_is_a_fault_and_its_books_close(
    pair: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautwave.session.sites.meeting.Meeting.known", lambda _: [])
    two = pair(STILL, *PLACE)
    two.master.ask("engage")
    two.run(3)
    assert both(two, "aligning")
    for half in (two.master, two.slave):
        half.control.axes[half.control._own[0]].port_energy = -1e-3  # as if it was moved
    two.run(40)
    assert both(two, "holding")
    assert "the slave starts" in two.slave.control.journal.entries[-1].text
    for half in (two.master, two.slave):  # the master finds it, the slave is told
        assert half.residual() < 1e-9
        assert half.control._resting
        assert half[f"{half.side}.lever.port_energy"][-1] == pytest.approx(-1e-3, abs=1e-6)


@SLOW
def test_a_word_that_was_lost_is_repeated(pair: Make) -> None:
    two = pair(STILL)
    two.run(5)
    two.master.ask("hold")
    two.run(1, two.master)
    two.slave.line.inbox.clear()
    two.run(5)
    assert two.slave.state == "idle"
    two.run(100)
    assert both(two, "holding")


@SLOW
def test_a_session_that_only_begins_anew_holds_too(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    two.renew("again")
    for half in (two.master, two.slave):
        half.line.inbox.popleft()  # that it is lost
    two.run(20)
    assert both(two, "holding")
    assert two.slave.residual() < 1e-9


@SLOW
def test_a_slave_is_held_until_it_knows_where_its_master_stands(pair: Make) -> None:
    two = pair(STILL)
    two.slave.ask("engage")
    two.run(20, two.slave)
    assert two.slave.state == "aligning"
    assert not two.slave.control._meeting.rest._let_go


@SLOW
def test_a_word_of_an_engage_that_was_taken_back_begins_nothing(pair: Make) -> None:
    two = pair(STILL)
    two.slave.ask("engage")
    two.run(5, two.slave)
    stands = {"at": {"lever": 0.0}, "to": None, "offsets": {}}
    for said, state in ([1, 1], "aligning"), ([0, 1], "engaged"):
        for kind in ("stands", "began"):
            two.slave.line.inbox.append({"peer": {kind: stands, "for": said}})
        two.run(10, two.slave)
        assert two.slave.state == state


@SLOW
def test_no_word_of_the_other_site_ends_a_run(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    for said in (
        5, "accord", [], {"accord": 5}, {"accord": ["engaged", 1, 2, 3]}, {"episode": None},
        {"accord": ["holding", False, False, [0]]}, {"for": 3, "began": 4}, {"stands": []},
    ):  # fmt: skip
        two.slave.line.inbox.append({"peer": said})
        two.run(2)
    assert both(two, "engaged")


def test_engage_and_hold_that_cross_are_a_hold_at_both(pair: Make) -> None:
    two = pair(STILL)
    two.run(5)
    two.lag = lambda: 10
    two.master.ask("engage")
    two.slave.ask("hold")
    two.run(60)
    assert both(two, "holding")
    assert not two.master.control.journal.engagements
    engage(two, two.slave)


@SLOW
def test_a_clutch_keeps_the_offset_that_there_is(pair: Make) -> None:
    two = pair(AWAY, *PLACE, "sites.wait_s=10")
    engage(two, two.master)
    assert abs(apart(two) - 0.1) < 0.02
    two.slave.ask("clutch")
    two.run(800 - two.slot)  # the hand goes on, the slave is held
    kept = apart(two)
    assert kept > 0.2
    engage(two, two.master)
    assert abs(apart(two) - kept) < 0.02
    clutched = two.master["operation.state"] == float(STATES.index("clutched"))
    assert not np.any(two.master["master.lever.commanded"][clutched])  # it is free
    assert "fault" not in [word for word, *_ in words(two.slave)]
    (granted,) = two.slave.control.summary()["granted_j"].values()
    assert of_all_sessions(two.slave, 1.0) == 2.0 + granted


@SLOW
def test_a_fault_at_one_site_holds_both_until_a_person_at_either_rests(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    two.slave.control.fault(two.slave.slot, 0, "slave.lever: over-temperature")
    two.run(3)
    assert both(two, "holding")
    assert words(two.master)[-1] == ("fault", "slave controller", "holding")
    two.master.ask("engage")
    two.run(2)
    assert words(two.master)[-1] == ("engage", "key", "holding")
    assert "not possible after a fault" in two.master.control.journal.entries[-1].text
    two.master.ask("rest")
    two.run(2)
    assert two.slave.control.wants_reset  # which the loop does
    two.slave.control.devices_are(two.slave.slot, "slave.lever: still hot")
    two.run(3)
    assert both(two, "holding")
    two.slave.ask("rest")
    two.run(2)
    two.slave.control.devices_are(two.slave.slot, "")
    two.run(3)
    assert both(two, "idle")
    engage(two, two.slave)
    assert two.slave.residual() < 1e-9


@SLOW
def test_a_dead_man_at_either_site_holds_both(pair: Make) -> None:
    two = pair(STILL)
    pedal = Held()
    two.slave.control.inbox.dead_men = [pedal]  # type: ignore[attr-defined]
    engage(two, two.master)
    pedal.is_held = False
    two.run(3)
    assert both(two, "holding")
    two.master.ask("engage")
    two.run(30)
    assert both(two, "holding")
    assert two.master.control.journal.engagements == 1


@SLOW
def test_who_is_gone_is_waited_for_in_a_hold_and_then_lost(pair: Make) -> None:
    two = pair(STILL, "link.lost_s=0.4")
    engage(two, two.master)
    two.slave.line.inbox.append({"lost": "its program ended"})
    two.run(2, two.slave)
    assert two.slave.state == "holding"
    two.slave.ask("engage")
    two.run(1, two.slave)
    assert "engage: master is not connected: its program ended" in (
        two.slave.control.journal.entries[-1].text
    )
    while two.slave.slot < two.slave.control.end:
        two.run(1, two.slave)
    error = two.slave.control.error()
    assert isinstance(error, LinkError)
    assert "master has been lost since" in str(error)


@SLOW
def test_a_short_silence_goes_on_by_itself_and_a_new_session_does_not(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    two.run(60, cut=True)
    assert two.slave.held
    two.run(60)
    assert both(two, "engaged")
    assert not two.slave.held
    two.renew("the connection was lost")
    two.run(60)
    assert both(two, "holding")
    assert [one[0] for one in words(two.master)].count("lost") == 1
    engage(two, two.slave)


@SLOW
def test_a_program_that_is_started_anew_hears_what_both_are_to_do(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    changes = (FREE, *COUNTS, STILL)
    two.sites["slave"] = two.slave = Half(two, "slave", changes, two.sockets[0], None)
    two.slave.slot = two.slot
    two.renew("its program ended")
    two.run(20)
    assert both(two, "holding")
    two.slave.ask("hold")
    two.slave.ask("rest")
    two.run(5)
    assert both(two, "idle")
    engage(two, two.slave)


@SLOW
def test_a_slave_that_is_not_in_its_place_in_time_is_held_and_both_say_so(
    pair: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautwave.session.sites.rest.Pull.effort", lambda *_: 0.0)
    monkeypatch.setattr("tautwave.session.sites.rest.PATIENCE_S", 0.2)
    two = pair(STILL, *PLACE, "sites.wait_s=2")
    two.master.ask("engage")
    two.run(1)
    two.until(lambda: both(two, "holding"))
    for half in (two.master, two.slave):
        (said,) = [one.text for one in half.control.journal.entries if one.word == "blocked"]
        assert said.startswith("slave lever not aligned: it is blocked, or its fric")
    assert two.slave.control.error() is None


@SLOW
def test_episodes_are_marked_at_both(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    two.master.ask("episode", "pick the red block")
    two.run(10)
    two.slave.ask("episode", "success")
    two.run(10)
    for half in (two.master, two.slave):
        (episode,) = half.control.journal.episodes
        assert (episode.name, episode.task, episode.success) == ("pick", "the red block", True)
    two.master.ask("episode", "success")  # as the other one did
    two.run(10)
    assert all(len(half.control.journal.episodes) == 1 for half in (two.master, two.slave))
    assert two.master.control.journal.entries[-1].text == "episode success: no episode is running"


@SLOW
def test_stop_ends_both(pair: Make) -> None:
    two = pair(STILL)
    engage(two, two.master)
    two.slave.ask("stop")
    two.run(3)
    assert both(two, "stopping")
    while two.master.slot < two.master.control.end or two.slave.slot < two.slave.control.end:
        two.run(1)
    for half in (two.master, two.slave):
        assert half.control.error() is None
        assert half.residual() < 1e-9


@SLOW
def test_a_scale_and_an_unknown_word_are_refused(pair: Make) -> None:
    two = pair(STILL)
    for word, sentence in (("scale", "scale: not available with two sites"), ("jump", "unknown")):
        two.master.ask(word, "0.5")
        two.run(1)
        entry = two.master.control.journal.entries[-1]
        assert entry.refused
        assert entry.text.startswith(sentence)


def test_a_random_day_of_both_closes_its_books() -> None:
    judge(random_day(7, 150))


@SLOW
@pytest.mark.parametrize("seed", range(3))
def test_random_days_of_both_close_their_books(seed: int) -> None:
    judge(random_day(seed))


def test_both_sites_are_operated_or_neither_is() -> None:
    from tautwave.config import load_rig
    from tautwave.session.sites.joining import shared_keys
    from tests.session.sites import RIG

    assert shared_keys(load_rig(RIG, ["operate={}"]))["operate"] is True
    with pytest.raises(ConfigError, match="two sites cannot change both ends in the same slot"):
        load_rig(RIG, ["operate={scales: [0.5]}"])
    with pytest.raises(ConfigError, match=r"with two sites, use sites\.align_speed"):
        load_rig(RIG, ["operate={align_speed: 0.1}"])
