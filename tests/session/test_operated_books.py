"""Two operated sites whose motors act beside the coupling: each books that once."""

from __future__ import annotations

import numpy as np
import pytest

from tests.session.test_operated_sites import Make, both, engage, pair

__all__ = ["pair"]


@pytest.mark.parametrize("shares", ["coulomb: 0.5, viscous: 0.5", "inertia: 0.6"])
def test_what_is_compensated_is_booked_once_at_each_site(pair: Make, shares: str) -> None:
    moving = "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [3, 1]]}"
    keys = [f"{side}.axes.lever.coulomb=1.0e-3" for side in ("master", "slave")]
    keys += [f"{side}.axes.lever.compensation={{{shares}}}" for side in ("master", "slave")]
    two = pair(moving, *keys)
    for word, state in (("clutch", "clutched"), ("hold", "holding")):
        engage(two, two.slave)
        two.run(100)
        two.slave.ask(word)
        two.run(2)
        two.until(lambda state=state: both(two, state))
        two.run(60)
    kind = "inertia" if "inertia" in shares else "compensation"
    for half in (two.master, two.slave):
        assert np.ptp(half[f"lever.{kind}_{half.side}.absorbed"]) > 0.0
        assert half.residual() < 1e-11
