"""What `tautwave bench buses` measures of this bus: it runs, in turns with its floor."""

from __future__ import annotations

import pytest

from tautwave_drivers.dynamixel.plugin import plugin

pytestmark = pytest.mark.realtime


@pytest.mark.slow
def test_every_figure_has_its_floor_and_the_loops_have_their_goal() -> None:
    costs = plugin.measure(40)
    assert len(costs) == 6
    for cost in costs:
        assert len(cost.spent_us) == len(cost.floor_us) == 40, cost.what
        assert min(cost.floor_us) > 0.0
        assert sorted(cost.spent_us)[20] < 50_000.0, f"{cost.what}: nobody answered"
    assert [cost.goal_ratio for cost in costs] == [1.5, None, 1.5, None, None, None]
