"""A device's own velocity in a wall's damper, as the laboratory measures it."""

from __future__ import annotations

import pytest

from tests.lab.measured_velocity import compared, jitter

TORQUE_STEP = 20.0 / 4095
"""Of a DM-J4310 [N m]."""


def test_a_measured_velocity_jitters_a_tenth_as_much() -> None:
    measured, differences = (jitter(400.0, 500.0, one) for one in (True, False))
    assert measured == pytest.approx(60.0 / 4095 / 12.0**0.5, rel=0.1)  # its step alone
    assert 10.0 < differences / measured < 14.0


@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [400.0, 1000.0])
def test_what_any_certified_damper_jitters_is_below_a_step_of_the_torque(rate_hz: float) -> None:
    found = compared(rate_hz, 500.0)
    assert found["jitter of differences"] * found["certified of differences"] < TORQUE_STEP
    assert found["certified measured"] < 0.75 * found["certified of differences"]
    assert found["stable measured"] > found["stable of differences"]
