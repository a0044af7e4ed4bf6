"""Walls in the motor, as the laboratory measures them: a few of its figures, made anew."""

from __future__ import annotations

import pytest

from tests.lab.motor_walls import both, by_host, certified, in_motor, swing


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rate_hz", "law", "holds", "swings"),
    [
        (400.0, by_host(0.0), 4.0, 8.0),
        (400.0, by_host(0.2), 60.0, 100.0),
        (400.0, by_host(0.2, -0.1), 60.0, 100.0),
        (400.0, in_motor(0.0), 45.0, 120.0),
        (1000.0, by_host(0.0), 10.0, 20.0),
    ],
)
def test_a_wall_holds_below_and_swings_above(
    rate_hz: float, law: object, holds: float, swings: float
) -> None:
    assert swing(law, holds, rate_hz) < 0.01 < swing(law, swings, rate_hz)  # type: ignore[arg-type]


def test_what_is_certified_holds_and_a_damper_that_is_too_much_is_not() -> None:
    assert certified(0.0, 400.0) == pytest.approx(16.0 / 3.0)
    assert certified(0.1, 400.0) == pytest.approx(31.8, abs=0.1)
    assert certified(0.2, 400.0) == 0.0
    assert certified(0.2, 400.0, 0.05) == pytest.approx(66.6, abs=0.1)
    assert swing(by_host(0.1), 0.95 * certified(0.1, 400.0), 400.0) < 0.01


def test_springs_in_both_motors_are_stable_at_1_khz_and_not_at_400_hz() -> None:
    """kp 240, kd 3 of the first joints of an OpenArm, here on a 4310 alone."""
    assert both(240.0, 3.0, 400.0).verdict == "unstable free"
    assert "nothing pays for its delay" in both(240.0, 3.0, 1000.0).verdict
    assert "unstable with a hand of" in both(240.0, 0.2, 1000.0).verdict
