"""Passive is not calm: what to say of a pair that buzzes; reads summaries, without NumPy."""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.summary.model import Side
from tautwave.types import VOLUNTARY_HZ

CHATTER_THRESHOLD = 0.2
"""Share of motion power above 8 Hz from which on a pair buzzes."""


def worst_share(shares: Mapping[Side, float | None]) -> tuple[str, float] | None:
    """Return the side with the greater `fast_share` of a summary, and that; None without any."""
    if not shares:
        return None
    side = max(shares, key=lambda it: shares[it] or 0.0)
    return side, shares[side] or 0.0


def high_frequency_share(shares: Mapping[Side, float | None], pair: str) -> str:
    """Return a sentence on a pair that buzzes, "" where it is calm."""
    worst = worst_share(shares)
    if worst is None or worst[1] <= CHATTER_THRESHOLD:
        return ""
    return (
        f"{pair}: not calm: {100.0 * worst[1]:.0f} % of the {worst[0]}'s motion power is above "
        f"{VOLUNTARY_HZ:g} Hz, faster than voluntary hand motion."
    )
