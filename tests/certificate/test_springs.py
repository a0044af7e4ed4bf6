"""Springs between two ends, at the edge of their certificates, and who moves both ends for gain."""

from __future__ import annotations

import pytest

from tests.certificate.springs import ROUNDING, attack, drawn, edge_of, is_certified

pytestmark = pytest.mark.slow
SEEDS = (1, 42)
BARE = (2, 8, 0)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_motion_of_both_ends_gains_from_a_certified_spring(seed: int) -> None:
    found = edge_of(drawn(seed))
    assert found is not None
    assert attack(found[0], seed).share < ROUNDING


def test_a_third_of_what_is_drawn_is_certified() -> None:
    assert sum(is_certified(drawn(seed)) for seed in range(30)) >= 10


@pytest.mark.parametrize("seed", BARE)
def test_a_little_beyond_its_certificate_a_bare_spring_pays(seed: int) -> None:
    found = edge_of(drawn(seed, bare=True))
    assert found is not None
    assert attack(found[0], seed).share < ROUNDING
    assert attack(found[0].times(1.0 / 1.3), seed).share > 1e-3
