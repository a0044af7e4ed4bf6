"""Grids of numbers, such as the angles at which a frequency response is looked at."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def merged(grids: Sequence[Floats], least: float = -math.inf, most: float = math.inf) -> Floats:
    """Return the numbers of some grids in increasing order, each once.

    Parameters
    ----------
    grids : sequence of array, shape (n,) each
        Without NaN, in any order.
    least, most : float
        What is below or above is taken for these.

    Returns
    -------
    array, shape (m,)
        What `numpy.unique` gives, which loads `numpy.ma` for it.
    """
    values = np.sort(np.clip(np.concatenate(grids), least, most))
    fresh = np.ones(len(values), dtype=bool)
    fresh[1:] = values[1:] != values[:-1]
    return values[fresh]
