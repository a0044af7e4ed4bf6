"""What a first rig file takes for granted of a motor hangs together."""

from __future__ import annotations

import pytest

from tautwave.types import Setting
from tautwave_drivers.assumed import assumed_axis


def test_inertia_damping_and_effort_are_those_of_one_geared_motor() -> None:
    """It turns for a fifth of a second when let go, and full effort takes five milliseconds."""
    axis = assumed_axis(3.0, 0.6, "a fifth of stall", Setting(5.0))
    inertia, damping = (axis[name].value for name in ("inertia", "damping"))
    assert inertia["value"] / damping["value"] == pytest.approx(0.2)
    assert 3.0 / inertia["value"] == pytest.approx(500.0)  # rad/s^2 at its greatest torque
    for believed in (inertia, damping):
        assert believed["lower"] == pytest.approx(0.6 * believed["value"])
    assert axis["effort_limit"].value / axis["effort_rate_limit"].value == pytest.approx(5e-3)
    assert "a fifth of stall" in axis["effort_limit"].comment
    low, high = axis["position_range"].value
    assert low == -high
    assert high < 3.14159 / 2  # not half a turn between stops that nobody has seen
