"""Two sites of an operated rig that hold: at once, and with a budget of their own."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tests.session.sites import RIG, Pair
from tests.session.test_aligning import AWAY, missed
from tests.session.test_aligning import STILL as STILL_HAND
from tests.session.test_operated_sites import PLACE, SLOW, STILL, Make, both, engage, pair

__all__ = ["pair"]


@pytest.mark.parametrize("place", [(), PLACE])
def test_a_hold_holds_while_no_new_session_has_come(pair: Make, place: tuple[str, ...]) -> None:
    """What had let go for the engagement before it let go of the hold, too."""
    moving = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [3, 1]]}"
    two = pair(moving, *place, "sites.align_speed=2", "sites.align_acceleration=20")
    engage(two, two.slave)
    two.run(200)
    two.lag = lambda: 500
    for half in (two.master, two.slave):
        half.ask("hold")
    two.run(30)
    for half in (two.master, two.slave):
        assert half.state == "holding"
        speed = half[f"{half.side}.lever.velocity"][-20:]
        sent = half[f"{half.side}.lever.commanded"][-20:]
        assert np.abs(speed).max() > 0.05
        control = half.control
        damping = control.params[control._own[0]].site.limit.stop_damping
        assert np.allclose(sent, -damping * speed, atol=1e-6)


@SLOW
def test_a_hold_after_a_way_that_was_broken_off_has_a_budget_of_its_own(pair: Make) -> None:
    two = pair(STILL, *PLACE, "sites.wait_s=10")
    two.slave.ask("engage")
    two.run(50)
    s = two.slave.control.axes[two.slave.control._own[0]]
    rest = two.slave.control._meeting.rest
    (which,) = two.slave.control._own
    capital = rest.holds.granted(which)
    assert -s.port_energy > capital  # the way took more than a hold may
    two.slave.ask("hold")
    two.run(20)
    assert s.port_energy > rest.holds._floor[which] - capital
    assert np.any(two.slave["slave.lever.commanded"][-10:])
    assert two.slave.residual() < 1e-9


def test_a_brake_holds_a_slave_and_its_master_only_while_both_hold(pair: Make) -> None:
    moving = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [3, 1]]}"
    load = "simulation.axes.slave.lever.load={constant: 0.01}"
    two = pair(moving, load, "sites.hold_effort_share=0.3")
    engage(two, two.slave)
    two.run(150)
    held: list[float] = []
    for word, state in (("clutch", "clutched"), ("hold", "holding")):
        two.slave.ask(word)
        two.run(2)
        two.until(lambda state=state: both(two, state))
        two.run(100)
        for half in (two.master, two.slave):
            sent = half[f"{half.side}.lever.commanded"][-60:]
            if half is two.master and state == "clutched":
                assert not sent.any()
                continue
            holds, (which,) = half.control._meeting.rest.holds, half.control._own
            brake = holds._brakes[which]
            assert brake is not None
            pulled = half[f"{half.side}.lever.position"][-60:] - brake._anchor
            pulled *= brake.params.stiffness
            assert np.abs(pulled).max() > 1e-3
            # Beside the spring there is the damper, on a hand or a device that moves.
            assert np.allclose(-sent, pulled, atol=0.3 * np.abs(pulled).max() + 1e-3)
            holds_so_far = 1 if half is two.master else 1 + (state == "holding")
            each = brake.params.reserve + brake.params.capital
            assert half.control._meeting.rest.granted[0] > holds_so_far * each
        brake = two.slave.control._meeting.rest.holds._brakes[two.slave.control._own[0]]
        assert brake is not None
        held.append(brake._anchor)
        assert two.slave.residual() < 1e-9
    assert held[1] == held[0]  # a new state is no other place


def test_a_brake_of_two_sites_without_its_numbers_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"sites\.hold_effort_share.*needs velocity_limit"):
        load_rig(RIG, ["sites.hold_effort_share=0.3", "slave.axes.lever.velocity_limit=null"])


def test_a_hand_leads_its_master_while_the_slave_finds_its_place(pair: Make) -> None:
    moving = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [3, 1]]}"
    two = pair(moving, *PLACE, "sites.hold_effort_share=0.3")
    two.slave.ask("engage")
    two.run(2)
    two.until(lambda: two.slave["link.aligning"][-1] == 1.0)
    two.run(60)
    assert both(two, "aligning")
    assert np.abs(two.master["master.lever.velocity"][-40:]).max() > 1e-3
    assert not two.master["master.lever.commanded"][-40:].any()


def test_a_slave_whose_way_is_broken_off_is_braked_where_it_is() -> None:
    two = Pair(AWAY, STILL_HAND, "sites.greatest_backlog=0.01", "sites.hold_effort_share=0.3")
    try:
        missed(two)
        two.until(lambda: two.slave["link.aligning"][-1] == 1.0)
        two.run(60)
        two.slave.line.inbox.append({"lost": "its program ended"})
        two.run(20)
        two.renew("it is back")
        two.until(lambda: bool(two.slave.control._meeting.rest._pulls))
        two.run(250)
        at = float(two.slave["slave.lever.position"][-1])
        two.slave.control.dead.add(two.slave.control._own[0])  # in fault it gets nothing
        two.run(1)
        assert two.slave["slave.lever.commanded"][-1] == 0.0
        two.slave.control.dead.clear()
        two.slave.line.inbox.append({"lost": "its program ended"})
        two.run(100, two.slave)
        assert np.abs(two.slave["slave.lever.position"][-99:] - at).max() < 0.015
        sent = two.slave["slave.lever.commanded"][-99:]
        assert np.abs(sent).max() < 0.015  # it led the axis back with 0.024
    finally:
        two.close()


def test_a_brake_that_supplied_what_it_may_is_a_fault_of_both_sites(pair: Make) -> None:
    two = pair(STILL, "sites.hold_effort_share=0.3")
    engage(two, two.slave)
    two.slave.ask("clutch")
    two.run(20)
    rest = two.slave.control._meeting.rest
    rest.holds.news.append(two.slave.control._own[0])
    two.run(3)
    two.until(lambda: both(two, "holding"))
    (entry,) = [one for one in two.slave.control.journal.entries if one.word == "fault"]
    assert entry.text.startswith("slave.lever: its brake has supplied all it may")
