"""Two sites of an operated rig that hold: at once, and with a budget of their own."""

from __future__ import annotations

import numpy as np
import pytest

from tests.session.test_operated_sites import PLACE, SLOW, STILL, Make, engage, pair

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
