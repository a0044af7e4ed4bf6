"""A pair at two rates: the merged matrix against that of every slot, and how large it gets."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.analysis.ports.multirate import RatedEnd, merged_matrix
from tautwave.analysis.ports.sampled_loop import LinearEnd
from tests.analysis.reference.multirate import period_matrix


def drawn_end(draw: np.random.Generator, states: int) -> LinearEnd:
    a = draw.normal(size=(states, states))
    a *= 0.9 / np.abs(np.linalg.eigvals(a)).max()
    return LinearEnd(a, draw.normal(size=states), draw.normal(size=states), ())


@pytest.mark.parametrize("divisors", [(1, 10), (10, 1), (5, 10), (2, 5), (3, 3), (4, 6)])
def test_merging_equal_waves_loses_only_zeros(divisors: tuple[int, int]) -> None:
    draw = np.random.default_rng(1)
    for samples in (0, 1, 3, 7, 10, 29):
        ends = [RatedEnd(drawn_end(draw, 3), divisor) for divisor in divisors]
        whole = np.linalg.eigvals(period_matrix(ends[0], ends[1], samples))
        merged = np.linalg.eigvals(merged_matrix(ends[0], ends[1], samples))
        sizes = [np.sort(np.abs(roots))[::-1][:4] for roots in (whole, merged)]
        assert sizes[1] == pytest.approx(sizes[0], rel=1e-6, abs=1e-4)


def test_a_long_line_to_a_slow_bus_stays_small() -> None:
    """Eigenvalues cost the cube: of 4,000 states a certificate took minutes."""
    draw = np.random.default_rng(2)
    ends = [RatedEnd(drawn_end(draw, 3), divisor) for divisor in (1, 10)]
    assert len(merged_matrix(ends[0], ends[1], 2000)) < 420
