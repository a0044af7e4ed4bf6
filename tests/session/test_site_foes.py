"""Two operated sites against who moves the devices of both: together they gain no more than both
claim over all sessions. `python -m tests.session.site_foes 0 1000` tries more, and prints them.
"""

from __future__ import annotations

import pytest

from tests.session.site_foes import meet

WORST = 16
"""The seed that gained most of the first forty."""


def test_who_moves_the_devices_of_both_sites_gains_less_than_both_claim() -> None:
    got = meet(WORST, 800, faults=False)
    assert got is not None
    assert got.engaged > 1
    assert 0.05 < got.share < 1.0


@pytest.mark.slow
def test_tanks_that_hold_more_than_is_stated_are_found_out() -> None:
    """Else nothing here could fail."""
    got = meet(WORST, 800, faults=False, reserve=30.0)
    assert got is not None
    assert got.share > 1.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [25, 29, 35])
def test_lost_words_packets_and_stalls_are_in_what_is_stated(seed: int) -> None:
    got = meet(seed, 800, faults=True)
    assert got is not None
    assert got.share < 1.0


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(1800)
def test_of_two_hundred_pairs_of_sites_nobody_gains_more() -> None:
    found = [meet(seed, 800, faults=seed % 2 == 1) for seed in range(1000, 1200)]
    shares = [got.share for got in found if got is not None]
    assert 8 * len(shares) > len(found)
    assert max(shares) < 1.0
