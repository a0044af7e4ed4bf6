"""Decimate a line without losing a peak."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Trace(NamedTuple):
    """A line to draw: `time` [s] and `value`, both of shape (n,); NaN breaks the line.

    `middle_time` and `middle` are the bucket means, both None if nothing was decimated: with noise
    they show the signal, and `value` the noise with all its peaks.
    """

    time: Floats
    value: Floats
    middle_time: Floats | None = None
    middle: Floats | None = None

    def times(self, factor: float) -> Trace:
        """The same line, every value multiplied."""
        middle = None if self.middle is None else factor * self.middle
        return Trace(self.time, factor * self.value, self.middle_time, middle)

    def is_rough(self) -> bool:
        """True if the line varies far more than its means do: noise."""
        if self.middle is None:
            return False
        inside, across = (np.nansum(np.abs(np.diff(v))) for v in (self.value, self.middle))
        return bool(inside > 3.0 * across)


def decimate(values: Floats, buckets: int = 900) -> NDArray[np.intp]:
    """Indices of the samples to keep: the first, least and greatest of every bucket.

    NaN breaks the line where it occurs. Both ends are always kept, and a short series is kept
    whole, so the line consists of true samples and every extreme survives.

    Parameters
    ----------
    values : shape (n,)
    buckets : about one per pixel of the plot

    Returns
    -------
    NDArray[np.intp]
        Increasing indices, at most 4 `buckets` + 6 of them.

    Source: M4 aggregation, Jugel et al., VLDB 2014, without the bucket's last sample.
    """
    total = len(values)
    if total <= 4 * buckets:
        return np.arange(total, dtype=np.intp)
    size = -(-total // buckets)
    whole = total // size
    kept = [_extremes(values[: whole * size].reshape(whole, size), 0)]
    if whole * size < total:
        kept.append(_extremes(values[whole * size :].reshape(1, -1), whole * size))
    kept.append(np.array([total - 1], dtype=np.intp))
    return np.unique(np.concatenate(kept)).astype(np.intp, copy=False)


def _extremes(rows: Floats, offset: int) -> NDArray[np.intp]:
    starts = offset + np.arange(rows.shape[0], dtype=np.intp) * rows.shape[1]
    gap = np.isnan(rows)
    if not gap.any():
        return np.concatenate([starts, starts + rows.argmin(axis=1), starts + rows.argmax(axis=1)])
    lowest = np.where(gap, np.inf, rows).argmin(axis=1)
    highest = np.where(gap, -np.inf, rows).argmax(axis=1)
    broken = gap.any(axis=1)
    first_gap = starts[broken] + gap[broken].argmax(axis=1)
    return np.concatenate([starts, starts + lowest, starts + highest, first_gap])


def trace(time: Floats, values: Floats, buckets: int = 900) -> Trace:
    """The line of `values` over `time` [s], decimated as in `decimate`."""
    kept = decimate(values, buckets)
    if len(kept) == len(values):
        return Trace(time, values)
    size = -(-len(values) // buckets)
    whole = len(values) // size
    ahead = slice(0, whole * size)
    middle = values[ahead].reshape(whole, size).mean(axis=1)
    middle_time = time[ahead].reshape(whole, size).mean(axis=1)
    return Trace(time[kept], values[kept], middle_time, middle)


def peak(*lines: Trace | None) -> float:
    """Greatest magnitude in some traces; 0 if nothing is finite."""
    greatest = 0.0
    for line in lines:
        if line is None:
            continue
        finite = np.abs(line.value[np.isfinite(line.value)])
        if finite.size:
            greatest = max(greatest, float(finite.max()))
    return greatest


def spread(*lines: Trace | None) -> float:
    """Greatest range, highest minus lowest, of some traces; 0 if nothing is finite."""
    widest = 0.0
    for line in lines:
        if line is None:
            continue
        finite = line.value[np.isfinite(line.value)]
        if finite.size:
            widest = max(widest, float(finite.max() - finite.min()))
    return widest
