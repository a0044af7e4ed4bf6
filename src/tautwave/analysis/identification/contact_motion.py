"""A recorded contact, filtered, and Hunt and Crossley's law on exact samples. SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import Array, Kernel

MIN_ROWS = 60
EXPONENTS = (1.0, 1.5, 2.2)
"""From which the exponent of a power law is refined."""


class Motion(NamedTuple):
    """A recording, filtered: what every model is fitted to."""

    position: Array
    kernel: Kernel
    rows: NDArray[np.int64]
    target: Array

    @property
    def speed(self) -> Array:
        """Filtered velocity of the rows."""
        return self.kernel.apply(self.position, 1)[self.rows]

    def filtered(self, values: Array, order: int = 0) -> Array:
        """A function of the position, filtered, at the rows."""
        return self.kernel.apply(values, order)[self.rows]


def motion_of(
    position: Array,
    effort: Array,
    period: float,
    *,
    cutoff_hz: float,
    known: NDArray[np.bool_] | None = None,
) -> Motion:
    """Filter a recording, `position` and `effort` at even times `period` apart [s].

    Raises
    ------
    ValueError
        Too short for the filter.
    """
    kernel = Kernel(period, cutoff_hz)
    target = kernel.apply(effort)
    use = np.ones(len(target), dtype=bool)
    if known is not None:
        use = kernel.mass(~known) < 1e-3
    rows = np.flatnonzero(use)[:: kernel.step]
    if len(rows) < MIN_ROWS:
        raise ValueError(
            f"{len(position)} samples are too few: {len(rows)} are left after the filter"
            f" of {kernel.cutoff_hz:.3g} Hz, and {MIN_ROWS} are needed"
        )
    return Motion(position, kernel, rows, target[rows])


def touching_share(ahead: Array) -> Array:
    """Share of each sample's period in contact, the motion between samples being straight."""
    step = np.abs(np.gradient(ahead))
    return np.asarray(np.clip(0.5 + ahead / np.maximum(step, 1e-300), 0.0, 1.0), dtype=np.float64)
