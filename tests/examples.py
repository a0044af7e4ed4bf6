"""How many examples a property is tried with, by the profile of hypothesis."""

from __future__ import annotations

from hypothesis import settings

FEW = 10
"""Of the profile `steady`, which a default run has."""


def tried(own: int) -> int:
    """Return how many examples a default test tries that has a number of its own.

    Half of them in profile `steady`, but not fewer than other tests try; all in any other.
    """
    return own if settings().max_examples > FEW else min(own, max(FEW, own // 2))
