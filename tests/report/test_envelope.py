import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from tautwave.report.figures.envelope import decimate, peak, trace

numbers = st.floats(-1e12, 1e12) | st.just(float("nan"))
series = hnp.arrays(np.float64, st.integers(1, 900), elements=numbers)


@given(series, st.integers(1, 60))
def test_keeps_the_extremes_of_every_bucket(values, buckets):
    kept = decimate(values, buckets)
    assert (np.diff(kept) > 0).all()
    assert kept[0] == 0
    assert kept[-1] == len(values) - 1
    assert len(kept) <= 4 * buckets + 6
    size = max(1, -(-len(values) // buckets))
    for start in range(0, len(values), size):
        bucket = values[start : start + size]
        shown = values[kept[(kept >= start) & (kept < start + size)]]
        if not np.isnan(bucket).all():
            assert np.nanmax(shown) == np.nanmax(bucket)
            assert np.nanmin(shown) == np.nanmin(bucket)
        assert np.isnan(shown).any() == np.isnan(bucket).any()


def test_a_single_sample_spike_survives_an_hour():
    values = np.zeros(3_600_000)
    values[1_234_567] = -7.0
    line = trace(np.arange(len(values)) * 1e-3, values)
    assert peak(line) == 7.0
    assert line.time[np.argmin(line.value)] == 1234.567
    assert len(line.time) < 4000


def test_peak_of_nothing_is_zero():
    assert peak(None, trace(np.arange(3.0), np.full(3, np.nan))) == 0.0
