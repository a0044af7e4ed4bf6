"""Springs between two ends, at the edge of their certificates, and who moves both ends for gain."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

from tautwave.certificate import certify
from tests.certificate.springs import ROUNDING, Drawn, attack, drawn, edge_of, is_certified

FEW = (1, 6, 12)
"""Of little memory: a position law with a line, one that must not clip, one with a wall."""

BARE = 24


def attacked(seeds: Iterable[int]) -> tuple[int, float]:
    """Return how many of some rigs are certified, and the most that anybody gained at an edge."""
    certified, most = 0, -1.0
    for seed in seeds:
        found = edge_of(drawn(seed))
        if found is not None:
            certified += 1
            most = max(most, attack(found, seed).share)
    return certified, most


@pytest.mark.parametrize("seed", FEW)
def test_nobody_gains_at_the_edge_of_a_certificate(seed: int) -> None:
    """At its very edge: with a hundredth less of damping it is refused."""
    found = edge_of(drawn(seed))
    assert found is not None
    assert certify(found.rig).verdicts["passive"].passed
    assert not found.gentle or certify(found.rig).verdicts["passive"].conditions
    assert attack(found, seed, tries=30, climbed=1).share < ROUNDING


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_of_two_hundred_rigs_nobody_gains_and_a_third_is_certified() -> None:
    certified, most = attacked(range(1000, 1200))
    assert certified >= 67
    assert most < ROUNDING


def test_a_third_of_what_is_drawn_is_certified() -> None:
    few = [one for one in map(drawn, range(40)) if one.memory < 30]
    assert sum(map(is_certified, few)) * 3 >= len(few)


@pytest.mark.slow
def test_of_laws_with_dampers_the_clipped_need_is_hardly_more_than_the_linear_one() -> None:
    """Where all that clips is counted, of laws that were drawn: half of them within a tenth."""
    ratios = []
    for seed in range(60):
        one = drawn(seed)
        pair = one.tree["coupling"]["pairs"]["a"]
        if one.memory < 30 and (pair["damping"] or pair.get("injection")):
            [coupling] = [e for e in certify(one.rig).elements if e.kind == "coupling"]
            numbers = coupling.numbers
            ratios.append(numbers.get("clipped_needed", 0.0) / numbers.get("needed", 1.0))
    assert len(ratios) >= 15
    assert float(np.median(ratios)) < 1.1
    assert max(ratios) < 1.3


def bare_edges(seeds: Iterable[int]) -> Iterable[tuple[int, Drawn]]:
    for seed in seeds:
        found = edge_of(drawn(seed, bare=True))
        if found is not None and found.memory < 30:
            yield seed, found


@pytest.mark.slow
def test_a_little_beyond_its_certificate_a_bare_spring_pays() -> None:
    """1.3 times beyond, more than half of them; at the edge none."""
    edges = list(bare_edges(range(BARE)))
    at_edge = [attack(found, seed).share for seed, found in edges]
    beyond = [attack(found.times(1.0 / 1.3), seed).share for seed, found in edges]
    assert len(edges) >= BARE // 4
    assert max(at_edge) < ROUNDING
    assert np.mean(np.array(beyond) > 1e-3) > 0.5
