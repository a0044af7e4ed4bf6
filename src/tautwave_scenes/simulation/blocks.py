"""Named lists of numbers laid out in two arrays, one of floats and one of whole numbers.

A call into compiled code costs by the argument: two arrays and a table of places are three of them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt


class Blocks(NamedTuple):
    """Both arrays, where each list begins and ends in its own, and a view of each by name.

    floats : (n,) float64; whole : (m,) int64; at : (2 * lists,) int64, in the order given.
    """

    floats: npt.NDArray[np.float64]
    whole: npt.NDArray[np.int64]
    at: npt.NDArray[np.int64]
    views: dict[str, Any]


def lay_out(given: Mapping[str, Sequence[float]], whole: Collection[str]) -> Blocks:
    """Copy lists into blocks; those named in `whole` hold whole numbers."""
    sizes = {True: 0, False: 0}
    at: list[int] = []
    for name, values in given.items():
        kind = name in whole
        at += [sizes[kind], sizes[kind] + len(values)]
        sizes[kind] += len(values)
    floats, counts = np.zeros(sizes[False]), np.zeros(sizes[True], np.int64)
    views: dict[str, Any] = {}
    for index, (name, values) in enumerate(given.items()):
        block: Any = counts if name in whole else floats
        part = slice(at[2 * index], at[2 * index + 1])
        block[part] = values
        views[name] = memoryview(block)[part]
    return Blocks(floats, counts, np.array(at, np.int64), views)


def put(view: Any, values: Sequence[float]) -> None:
    """Write numbers to the front of a view; a memoryview is copied as a whole."""
    if isinstance(values, memoryview):
        view[:] = values
        return
    for at, value in enumerate(values):
        view[at] = value
