"""Grids of numbers: in order, each once, without what `numpy.unique` loads for masked arrays."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tautwave.analysis.grids import merged

NUMBERS = st.floats(allow_nan=False) | st.integers(-3, 3).map(float)


@given(st.lists(st.lists(NUMBERS, max_size=9), min_size=1, max_size=3), NUMBERS, NUMBERS)
def test_it_is_what_numpy_finds(grids: list[list[float]], one: float, other: float) -> None:
    arrays = [np.array(grid, dtype=np.float64) for grid in grids]
    least, most = sorted((one, other))
    whole = np.concatenate(arrays)
    assert np.array_equal(merged(arrays), np.unique(whole))
    assert np.array_equal(merged(arrays, least, most), np.unique(np.clip(whole, least, most)))


def test_masked_arrays_are_not_loaded() -> None:
    code = (
        "import sys; from tautwave.analysis.grids import merged; import numpy as np;"
        "merged([np.zeros(2)]); assert 'numpy.ma' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
