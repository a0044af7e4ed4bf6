"""A recorded contact, filtered, and Hunt and Crossley's law on exact samples. SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import Array, Kernel, solve

LEAST_ROWS = 60
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
    if len(rows) < LEAST_ROWS:
        raise ValueError(
            f"{len(position)} samples are too few: {len(rows)} are left after the filter"
            f" of {kernel.cutoff_hz:.3g} Hz, and {LEAST_ROWS} are needed"
        )
    return Motion(position, kernel, rows, target[rows])


def touching_share(ahead: Array) -> Array:
    """Share of each sample's period in contact, the motion between samples being straight."""
    step = np.abs(np.gradient(ahead))
    return np.asarray(np.clip(0.5 + ahead / np.maximum(step, 1e-300), 0.0, 1.0), dtype=np.float64)


def fit_hunt_crossley(depth: Array, rate: Array, effort: Array) -> tuple[float, float, float]:
    """Stiffness k, loss coefficient c and exponent n of `F = k y^n + c y^n dy/dt`.

    For samples with exact depth [m] and rate [m/s] and no offset, unfiltered; y > 0.
    """

    def columns(n: float) -> Array:
        power = depth**n
        return np.stack([power, power * rate], axis=1)

    def residual(n: float) -> Array:
        part = columns(n)
        rest: Array = effort - part @ solve(part, effort)
        return rest

    n = min(EXPONENTS, key=lambda e: float(np.sum(residual(e) ** 2)))
    for _ in range(60):
        here = residual(n)
        slope = (residual(n + 1e-6) - residual(n - 1e-6)) / 2e-6
        change = -float(slope @ here) / float(slope @ slope)
        n += min(max(change, -0.3), 0.3)
        if abs(change) < 1e-13 * n:
            break
    found = solve(columns(n), effort)
    return float(found[0]), float(found[1]), n
