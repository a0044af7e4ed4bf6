"""Whole turns of an encoder that knows its angle, but not how often it has gone round."""

from __future__ import annotations

import math


def turns_back(position: float, position_range: tuple[float, float]) -> list[int]:
    """Return by how many whole turns a position [rad] may be off, for it to be in its range.

    Empty where no whole turns bring it there, one where the range decides it, 0 first where it is
    inside already. An infinite range decides nothing: 0 alone.
    """
    low, high = position_range
    if not (math.isfinite(low) and math.isfinite(high)):
        return [0]
    first = math.ceil((low - position) / math.tau)
    last = math.floor((high - position) / math.tau)
    return sorted(range(first, last + 1), key=lambda turns: (abs(turns), turns))
