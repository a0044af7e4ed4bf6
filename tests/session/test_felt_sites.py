"""What the master's site renders of the slave's weight, with the slave at another site."""

from __future__ import annotations

import numpy as np
import pytest

from tests.session.site_days import COUNTS, FREE
from tests.session.sites import Pair


def test_the_hand_feels_the_weight_of_the_place_where_the_other_site_stands() -> None:
    two = Pair(
        FREE,
        *COUNTS,
        "slave.axes.lever.load={sine: -0.05, reflect_load: true}",
        "simulation.axes.slave.lever.load={sine: -0.05}",
        "coupling.pairs.lever.offset=0.0",
        "coupling.pairs.lever.engage_tolerance=0.05",
        "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0], [9, 0.6]]}",
    )
    (load,) = two.master.control.loads

    def felt() -> float:
        row = [0.0] * len(load.columns)
        load.fill(row, 0)
        return row[load.columns.index("load.master.lever.effort")]

    for turn in range(2):
        two.master.ask("engage")
        two.run(1)
        two.until(lambda: two.master.state == two.slave.state == "engaged")
        two.run(700)
        x, y = (h[f"{h.side}.lever.position"][-1] for h in (two.master, two.slave))
        assert felt() == pytest.approx(-0.05 * np.sin(y), abs=1e-3)
        assert abs(y) > 0.02
        two.master.ask("clutch")
        two.run(600)
        assert felt() == 0.0
        assert (abs(x - y) > 0.05) == (turn == 1)
    two.close()
