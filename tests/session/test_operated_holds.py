"""Two sites of an operated rig that hold: at once, and with a budget of their own."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tests.session.site_days import FREE
from tests.session.sites import RIG, Pair
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
        assert two.slave.residual() < 1e-9


def test_between_sessions_that_no_person_operates_only_slaves_are_braked() -> None:
    two = Pair(FREE, STILL, "sites.hold_effort_share=0.3")
    try:
        braked = {half.side: half.control._meeting.rest.braked for half in (two.master, two.slave)}
    finally:
        two.close()
    with pytest.raises(ConfigError, match=r"sites\.hold_effort_share.*needs velocity_limit"):
        load_rig(RIG, ["sites.hold_effort_share=0.3", "slave.axes.lever.velocity_limit=null"])
    assert braked == {"master": False, "slave": True}
