"""The ceiling of the engage ramp is for what pushes: what resists a thrown device may pass it."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from tautwave.laws.limit import LimitParams, rising_bound

LIMIT = LimitParams(effort=2.0)
HALF_MOBILITY = 0.25
usual = st.floats(-3.0, 3.0)


def bound(
    asked: float, last: float = 0.0, moved: float = 0.0, along: float = 0.0, ceiling: float = 0.1
) -> float:
    return rising_bound(LIMIT, asked, last, moved, along, HALF_MOBILITY, ceiling)


@given(usual, usual, usual, usual, st.floats(0.0, 2.0))
def test_what_pushes_stays_below_the_ceiling(
    asked: float, last: float, moved: float, along: float, ceiling: float
) -> None:
    """A device that did not move against an effort, or has come back from where it was thrown."""
    found = bound(asked, last, moved, along, ceiling)
    assert found >= ceiling
    if asked * moved <= 0.0:
        assert found == ceiling


@given(usual, usual, usual, usual, st.floats(0.0, 2.0))
def test_what_grows_beyond_it_stops_the_device_at_most(
    asked: float, last: float, moved: float, along: float, ceiling: float
) -> None:
    """Work done on the device in the period: an effort that grows takes, whatever its size."""
    sent = math.copysign(min(abs(asked), bound(asked, last, moved, along, ceiling)), asked)
    if abs(sent) > max(ceiling, abs(last)):
        assert sent * (along - HALF_MOBILITY * sent) >= -1e-12
        assert sent * along > 0.0


def test_what_it_grew_to_may_stay_as_long_as_it_has_the_same_sign() -> None:
    assert bound(1.0, last=0.7, moved=0.02, along=0.0) == 0.7
    assert bound(1.0, last=0.7, moved=0.02, along=-1.0) == 0.7
    assert bound(-1.0, last=0.7, moved=-0.02, along=-0.001) == 0.1
    assert bound(1.0, last=-0.7, moved=0.02, along=0.0) == 0.1


def test_no_effort_that_is_not_a_number_opens_it() -> None:
    for at in range(4):
        values = [1.0, 0.7, 0.02, 1.0]
        values[at] = math.nan
        found = rising_bound(LIMIT, *values, HALF_MOBILITY, 0.1)
        assert found in (0.1, 0.7, 2.0)
        if at in (0, 2):
            assert found == 0.1
