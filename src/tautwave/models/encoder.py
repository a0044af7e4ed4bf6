"""Quantisation of a sensor or a command; the quantum has the unit of the value."""

from __future__ import annotations

import math

_WHOLE = 4.0e15  # beyond this many quanta a float has no digits left to round


def quantise(value: float, quantum: float) -> float:
    """Nearest multiple of `quantum` (halves go up); 0 leaves the value as it is. Idempotent."""
    if not quantum > 0.0:
        return value
    count = value / quantum
    if not math.fabs(count) < _WHOLE:
        return value
    return float(math.floor(count + 0.5)) * quantum
