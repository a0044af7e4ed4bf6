"""A site that leaves: the other one hears how, once, and has its time to see it come back."""

from __future__ import annotations

from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.errors import BusTimeout
from tautwave.runtime.loop import LoopResult
from tautwave.session.sites.desk_line import Leaving
from tautwave.session.sites.joining import Joined, joined
from tautwave.sites.control import Session
from tests.session.sites import RIG, Make, Pair

PLACE = ("coupling.pairs.lever.offset=0.3", "coupling.pairs.lever.engage_tolerance=0.01")


def left(two: Pair, error: BaseException | None) -> None:
    """Let the master's loop be over."""
    line: Any = two.master.line
    link = Joined(line, two.sockets[1], two.session("slave"), None)
    link.leave(LoopResult(500, 0, (), (), (), error, None, False, True))


def test_a_run_whose_last_slots_are_skipped_takes_its_leave(pair: Make) -> None:
    two = pair()
    two.run(500)
    two.master.control.stop_after(two.master.slot)
    assert not two.master.cycle(skipped=two.master.control.end)
    left(two, None)
    two.run(5, two.slave)
    assert two.slave.control.ended.startswith("master ended the session at 0.")
    left(two, BusTimeout("bus hand: silent"))
    two.run(5, two.slave)
    assert not two.slave.held  # said once


def test_a_fault_of_a_device_is_a_reason_to_the_other_site(pair: Make) -> None:
    two = pair()
    two.run(500)
    assert two.master.control.fault(two.master.slot, 0, "master.lever: too hot")
    assert not two.master.control.fault(two.master.slot, 0, "master.lever: no torque")
    two.run(2)
    assert not two.slave.control.ended
    assert two.slave.control._left == "it stopped: master.lever: too hot"
    assert str(two.master.control.error()) == "master.lever: too hot"


def test_a_bus_that_is_refused_before_anything_moves_is_a_reason_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[Any] = []

    class ParameterPage(Leaving):
        def __init__(self, order: Any) -> None: ...

        def send(self, **message: Any) -> None:
            told.append(message)

        def wait(self, *given: Any) -> Session:
            return Session(b"", b"", "slave", {})

        def close(self) -> None:
            told.append("closed")

    monkeypatch.setattr("tautwave.session.sites.joining.DeskLine", ParameterPage)
    monkeypatch.setattr("tautwave.sites.certificates.identity_files", lambda *given: None)
    rig = load_rig(RIG, ("sites.here=master", "sites.slave.address=127.0.0.1"))
    with pytest.raises(BusTimeout), joined(rig, print):
        raise BusTimeout("bus hand: silent")
    assert told == [{"send": {"stops": "bus hand: silent"}}, "closed"]


def test_who_is_lost_while_slaves_go_to_their_places_may_come_back(pair: Make) -> None:
    """Each time within `link.lost_s`, which used to count from the start of the run."""
    still = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0]]}"
    two = pair(*PLACE, still, "link.lost_s=0.3")
    words = [{"peer": {"left": "it ended"}}, {"lost": "gone"}, {"peer": {"stops": "too hot"}}]
    for slot, word in zip((350, 650, 950), words, strict=True):
        two.run(slot - two.slot)
        for half in (two.master, two.slave):
            half.line.inbox.append(word)
        two.run(200)
        assert two.slave.control.error() is None
        assert not two.slave.control._engaged
        if slot == 350:
            two.slave.line.inbox.append({"lost": "gone"})
            two.run(1)
            assert two.slave.control._left == "it ended"  # what was said first
        if slot < 950:
            two.renew("")
    two.run(150)
    why = str(two.slave.control.error())
    assert "master has been lost since 0.950 s: " in why
    assert "it stopped: too hot; not back within 0.3 s" in why


def test_a_session_that_is_asked_for_anew_has_its_time_too(pair: Make) -> None:
    two = pair(*PLACE, "link.lost_s=0.3")
    two.run(400)
    two.lag = lambda: 200
    two.slave.control._renew("lever moved before the session began")
    two.run(250)
    assert two.slave.control.error() is None
    assert two.slave.control._left == ""


@pytest.mark.parametrize("slots", [0, 5, 500])
@pytest.mark.parametrize(
    ("error", "said"),
    [(None, ""), (KeyboardInterrupt(), ""), (ZeroDivisionError(), "ZeroDivisionError"),
     (BusTimeout("x" * 100_000), "x" * 2000)],
)  # fmt: skip
def test_whenever_a_site_leaves_the_other_one_hears_how(
    pair: Make, slots: int, error: BaseException | None, said: str
) -> None:
    two = pair()
    two.run(slots)
    left(two, error)
    left(two, BusTimeout("said twice"))
    two.run(2, two.slave)
    control = two.slave.control
    assert bool(control.ended) is not bool(said)
    assert control._left == (f"it stopped: {said}" if said else "")


def test_a_fault_of_a_bus_is_a_reason_to_the_other_site(pair: Make) -> None:
    two = pair()
    two.run(500)
    left(two, BusTimeout("bus hand: silent"))
    two.run(5, two.slave)
    assert two.slave.held
    why = two.slave.control.sessions[0]["silences"][0]["why"]
    assert why == "it stopped: bus hand: silent"
