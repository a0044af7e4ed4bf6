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


def doubt(position: float, position_range: tuple[float, float], per_turn: float = math.tau) -> str:
    """Return what a range leaves open of a position inside it, after a power-up; empty if nothing.

    Parameters
    ----------
    position : float
        Of the axis, as its encoder has it [rad or m].
    position_range : tuple of float
        Of the axis [rad or m].
    per_turn : float
        How far the axis goes in one turn of the encoder [rad or m].
    """
    size = math.tau / per_turn
    turns = turns_back(position * size, (position_range[0] * size, position_range[1] * size))
    others = [f"{position + one * per_turn:.4g}" for one in turns if one != 0]
    if len(turns) < 2 or turns[0] != 0:
        return ""
    told = " or ".join(others[:2]) + (" and further" if len(others) > 2 else "")
    return (
        f"taken to be at {position:.4g}; its encoder loses whole turns ({per_turn:.4g}) with its "
        f"power, and position_range also holds {told}. Look where it stands before it moves, or "
        "narrow position_range to less than a turn"
    )
