"""A slave of two sites is brought into place before a session: limits, energy, who knows where."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.errors import LinkError
from tautwave.laws.rest.alignment import AlignParams
from tautwave.rig import build_rig
from tautwave.rig.operated.operation import site_pulls
from tautwave.runtime.control import CoupledControl
from tautwave.session.sites.agreed import with_sessions
from tautwave.summary import checked
from tautwave.summary.model import Pair as PairSummary
from tautwave.summary.model import Site
from tests.session.sites import RIG, Half, Pair

Make = Callable[..., Pair]
SLOW = pytest.mark.slow
STILL = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [0.3, 0.15]]}"
AWAY = "simulation.environment.lever={type: free}"
STEP = 2.094e-5


@pytest.fixture
def pair() -> Iterator[Make]:
    with ExitStack() as stack:

        def make(*changes: str) -> Pair:
            made = Pair(AWAY, *changes)
            stack.callback(made.close)
            return made

        yield make


def missed(two: Pair) -> None:
    """Let the hand move the master by 0.15 rad while the slave hears nothing of it."""
    two.run(30)
    two.run(500, cut=True)


def engaged_again(two: Pair) -> None:
    sessions = two.slave.control.sessions
    count = len(sessions)
    two.until(lambda: len(sessions) > count and "engaged_s" in sessions[-1], 3000)


def pulls_of(half: Half) -> AlignParams:
    (params,) = half.control._meeting.rest._approach.pulls.values()
    return params.law


def place_of(half: Half, side: str) -> float:
    return float(half[f"{side}.lever.position"][-1])


def test_a_new_session_waits_until_the_slave_is_in_its_place(pair: Make) -> None:
    two = pair(STILL, "sites.greatest_backlog=0.01")
    missed(two)
    before = place_of(two.slave, "slave")
    engaged_again(two)
    two.run(5)
    aligning = two.slave["link.aligning"] == 1.0
    assert 400 < aligning.sum() < 2000
    assert np.all(two.slave["link.slot"][aligning] == -1)  # nothing is coupled meanwhile
    at = two.slave["slave.lever.position"]
    assert abs(before - place_of(two.master, "master")) > 0.1
    assert abs(at[-1] - place_of(two.master, "master")) < 0.05
    # Its limits, and the motor's own energy against what was granted before it moved.
    speed = np.diff(at[aligning])[20:].reshape(-1) * 1e3
    slow = np.convolve(speed, np.ones(20) / 20, "valid")  # an encoder step is 0.02 rad/s
    assert 0.2 < np.abs(slow).max() < 0.3 * 1.1
    effort = np.abs(two.slave["slave.lever.commanded"][aligning])
    assert 0.0 < effort.max() <= 0.2 * 1.125 + 1e-12
    given = -two.slave["lever.align_slave.absorbed"]
    (granted,) = two.slave.control.summary()["granted_j"].values()
    motion = granted - 2.0 * pulls_of(two.slave).reserve
    assert 1e-5 < given.max() < motion < 0.05
    two.run(200)
    for half in (two.master, two.slave):
        assert half.residual() < 1e-9
    first, second = two.slave.control.sessions
    assert second["offsets"] == first["offsets"]  # where both met first
    apart = place_of(two.slave, "slave") - place_of(two.master, "master")
    assert abs(apart - first["offsets"]["lever"]) < 0.01
    site = checked(Site, {"site": "slave", **two.slave.control.summary()})
    pairs = with_sessions({"lever": PairSummary(claim_j={"slave": 1.0})}, site)
    assert pairs["lever"].claim_j["slave"] == pytest.approx(2.0 + granted)


@SLOW
def test_the_law_that_brings_it_there_is_not_for_show(
    pair: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without it, the new session is put off for good: nothing begins with both apart."""
    monkeypatch.setattr("tautwave.session.sites.rest.Pull.effort", lambda *_: 0.0)
    two = pair(STILL, "sites.greatest_backlog=0.01", "sites.wait_s=1")
    missed(two)
    two.run(2600)  # until the master gives up, and `link.lost_s` for it to come back
    assert "engaged_s" not in two.slave.control.sessions[-1]
    assert two.slave.control.stopped


@SLOW
def test_a_slave_in_whose_way_something_is_says_so_on_both_sides(
    pair: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tautwave.session.sites.rest.PATIENCE_S", 0.5)
    wall = "simulation.environment.lever={type: wall, position: 0.05, stiffness: 250}"
    two = pair(STILL, wall, "sites.greatest_backlog=0.01", "sites.wait_s=3", "link.lost_s=3")
    missed(two)
    while two.slave.slot < two.slave.control.end:
        two.run(1)
    for half in (two.slave, two.master):
        error = half.control.error()
        assert isinstance(error, LinkError)
        assert "slave lever not aligned: it is blocked, or its friction" in str(error)
        assert "; not ready within 3 s" in str(error)
    aligning = two.slave["link.aligning"] == 1.0
    assert np.abs(two.slave["slave.lever.commanded"][aligning]).max() <= 0.2 * 1.125 + 1e-12
    given = -two.slave["lever.align_slave.absorbed"]
    (granted,) = two.slave.control.summary()["granted_j"].values()
    assert given.max() < granted
    assert two.slave.residual() < 1e-9


@SLOW
def test_a_slave_that_is_started_anew_is_told_where_its_place_is(pair: Make) -> None:
    two = pair(STILL)
    two.run(500)
    met = two.slave.control.sessions[0]["offsets"]["lever"]
    old = two.slave
    two.sites["slave"] = two.slave = Half(two, "slave", (AWAY, STILL), two.sockets[0], None)
    two.slave.slot = two.slot  # its device stands at 0
    two.slave.line.inbox.clear()
    del old
    two.renew("its program ended")
    two.until(lambda: "engaged_s" in two.slave.control.sessions[-1], 3000)
    two.run(100)
    assert (two.slave["link.aligning"] == 1.0).sum() > 300
    assert two.slave.control.sessions[-1]["offsets"]["lever"] == met
    assert abs(place_of(two.slave, "slave") - place_of(two.master, "master") - met) < 0.02
    assert two.slave.residual() < 1e-9


@SLOW
def test_a_pair_with_an_offset_is_brought_to_it_before_its_first_session(pair: Make) -> None:
    """A rig's offset used to end such a run: nobody was brought into place between two machines."""
    two = pair(
        "coupling.pairs.lever.offset=0.1", "coupling.pairs.lever.engage_tolerance=0.01",
        "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0]]}",
    )  # fmt: skip
    two.until(lambda: "engaged_s" in two.slave.control.sessions[-1], 3000)
    two.run(300)
    assert abs(place_of(two.slave, "slave") + 0.1 - place_of(two.master, "master")) < 0.01
    assert two.slave.residual() < 1e-9


@SLOW
def test_a_peer_that_goes_while_the_slave_is_on_its_way_leaves_it_held(pair: Make) -> None:
    two = pair(STILL, "sites.greatest_backlog=0.01")
    missed(two)
    two.until(lambda: two.slave["link.aligning"][-1] == 1.0)
    two.run(100)
    two.slave.line.inbox.append({"lost": "its program ended"})
    two.run(100, two.slave)
    assert not two.slave.control._meeting.rest._pulls
    here = place_of(two.slave, "slave")
    while two.slave.slot < two.slave.control.end:
        two.run(1, two.slave)
    assert "master has been lost since" in str(two.slave.control.error())
    assert abs(place_of(two.slave, "slave") - here) < 0.02
    assert abs(two.slave["slave.lever.commanded"][-1]) < 1e-3
    assert two.slave.residual() < 1e-9


def test_what_brings_slaves_into_place_is_of_the_rigs_own_numbers() -> None:
    def found(*more: str) -> Any:
        keys = ("sites.align_speed=0.1", "sites.place_tolerance=0.02", *more)
        rig = load_rig(RIG, keys)
        control = build_rig(rig, clock="fake").control
        assert isinstance(control, CoupledControl)
        return site_pulls(rig, control)

    pulls, tolerances = found()
    assert tolerances == [0.02]
    assert pulls[0].reach == 0.01
    assert pulls[0].law.speed == 0.1
    assert pulls[0].law.effort <= 0.2 * 1.125
    slow, short, weak = (
        found(key)[0][0].law
        for key in (
            "slave.axes.lever.velocity_limit=5",
            "loop.overrun_limit=5",
            "slave.axes.lever.effort_rate_limit=1",
        )
    )
    assert slow.reserve < 0.7 * pulls[0].law.reserve
    assert short.reserve < 0.7 * pulls[0].law.reserve
    assert weak.brake < 0.7 * pulls[0].law.brake
