"""Seeded random streams: one per element and purpose, so that omitting one affects no other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

BLOCK = 4096  # drawn in blocks; the numbers equal those of one long draw

NOISE, MISSING, OVERRUN, HAND = 0, 1, 2, 3
"""Purposes; the last word of a seed."""


def normal_stream(seed: tuple[int, ...]) -> Iterator[float]:
    """Yield standard normal numbers."""
    rng = np.random.default_rng(seed)
    while True:
        yield from rng.standard_normal(BLOCK).tolist()


def uniform_stream(seed: tuple[int, ...]) -> Iterator[float]:
    """Yield numbers in [0, 1)."""
    rng = np.random.default_rng(seed)
    while True:
        yield from rng.random(BLOCK).tolist()
