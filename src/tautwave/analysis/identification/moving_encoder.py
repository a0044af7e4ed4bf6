"""Step and noise of an encoder from a lever that moves, where only differences tell them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import (
    Array,
    Estimate,
    noise_squares,
    student_quantile,
)

BLOCKS = 20
ON_LATTICE = 0.1  # rms distance of differences from multiples of the step, in steps
MIN_STEP = 1e-3  # of the median difference: less is rounding of the file
TRIED = 60


def moving_step(position: Array) -> float:
    """Return the step that all differences are multiples of, 0 where there is none."""
    changes = np.abs(np.diff(position))
    typical = float(np.median(changes[changes > 0.0])) if np.any(changes > 0.0) else 0.0
    able = np.sort(changes[changes > MIN_STEP * typical])
    if len(able) < BLOCKS:
        return 0.0
    small = float(np.median(able[: max(5, len(able) // 200)]))
    for divisor in range(1, TRIED):
        step = small / divisor
        for _ in range(3):
            counts = np.rint(able / step)
            step = float(np.sum(able * counts) / max(np.sum(counts * counts), 1.0))
        apart = able / step - np.rint(able / step)
        if step > 0.0 and math.sqrt(float(np.mean(apart**2))) < ON_LATTICE:
            # A lattice twice as fine fits as well; so much finer than what is there is none.
            return step if typical < 1e3 * step else 0.0
    return 0.0


def moving_noise(position: Array, step: float, known: NDArray[np.bool_] | None = None) -> Estimate:
    """Return the standard deviation of the noise without the step's own, q / sqrt 12.

    Fourth differences of a smooth motion are those of its white noise; the interval is from the
    scatter between parts.
    """
    own = step * step / 12.0
    squares = noise_squares(position, known)
    parts = [float(np.mean(part)) - own for part in np.array_split(squares, BLOCKS)]
    value = max(float(np.mean(squares)) - own, 0.0)
    half = student_quantile(BLOCKS - 1) * float(np.std(parts, ddof=1)) / math.sqrt(BLOCKS)
    return Estimate(
        math.sqrt(value), math.sqrt(max(value - half, 0.0)), math.sqrt(max(value + half, 0.0))
    )
