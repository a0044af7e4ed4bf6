"""Splits of recordings: chosen on some, reported on the others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.laws import port
from tests.lab.port.hands import PERIOD, Hand
from tests.lab.recovery import SLOPES, share, slope_of, splits


def test_what_is_chosen_on_some_is_reported_on_the_others() -> None:
    """With slope 2 best on three recordings and worst on one, a half with that one avoids it."""
    found = {name: dict.fromkeys(SLOPES, 0.5) for name in "abcd"}
    for name in "abc":
        found[name][2.0] = 0.1
    found["d"][2.0] = 0.9
    worst, chosen = splits(found)
    assert len(worst) == 6
    assert chosen[2.0] == 3
    assert sorted(worst) == pytest.approx([0.5] * 3 + [0.9] * 3)


def test_a_slope_lasts_as_long_as_it_is_asked_for() -> None:
    kept = port.RECOVERY_SLOPE
    with slope_of(1.5):
        assert port.RECOVERY_SLOPE == 1.5
    assert kept == port.RECOVERY_SLOPE


@pytest.mark.slow
def test_a_hand_is_replayed_from_where_it_was_recorded(tmp_path: Path) -> None:
    time = np.arange(0.0, 2.0, PERIOD)
    wave = 0.1 + 0.02 * np.sin(5.0 * time)
    hand = Hand("a_spring", "spring", wave, np.full_like(wave, 0.01))
    found = share(hand, tmp_path, 3.0, 0.05)
    assert 0.0 < found < 1.0
