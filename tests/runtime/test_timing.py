"""The histogram of durations: quantiles within a bin, exact maximum, no allocation needed."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.runtime.timing import BINS, Histogram

durations = st.lists(st.integers(-5_000, 40_000_000), min_size=1, max_size=200)


@given(durations, st.sampled_from([0.5, 0.99, 0.999]))
def test_quantiles_are_upper_bin_edges(values: list[int], share: float) -> None:
    histogram = Histogram()
    for value in values:
        histogram.add(value)
    exact = np.sort(np.maximum(values, 0))[int(np.ceil(share * len(values))) - 1] / 1000.0
    reported = histogram.quantile_us(share)
    greatest = max(0, *values) / 1000.0
    if exact < BINS:
        assert min(exact, greatest) <= reported <= exact + 1.0
    else:
        assert reported == pytest.approx(min(BINS + 1.0, greatest))
    assert histogram.summary()["max"] == greatest


def test_an_empty_one_says_zero() -> None:
    assert Histogram().summary() == {"p50": 0.0, "p99": 0.0, "p999": 0.0, "max": 0.0}


def test_what_is_too_long_is_counted_and_its_maximum_kept() -> None:
    histogram = Histogram()
    for _ in range(99):
        histogram.add(10_000)
    histogram.add(3_000_000_000)
    assert histogram.quantile_us(0.5) == 11.0
    assert histogram.summary()["max"] == 3_000_000.0
