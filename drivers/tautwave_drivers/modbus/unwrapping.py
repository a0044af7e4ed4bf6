"""A position of 16 bits that comes round, made one that does not."""

from __future__ import annotations

import math

ROUND = 1 << 16


class Unwrapper:
    """Adds the rounds that a count of 16 bits has made.

    The first value is where the range has room for it; from then on less than half a round lies
    between two values, as long as the axis keeps its velocity limit.

    Parameters
    ----------
    low, high : float
        The axis' range [counts]; less than a round.
    fastest : float
        Its velocity limit [counts/s].
    """

    def __init__(self, low: float, high: float, fastest: float) -> None:
        self._low, self._high = low, high
        self._longest_ns = 1e9 * 0.5 * ROUND / fastest if fastest > 0.0 else math.inf
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._last: int | None = None
        self._at_ns = 0

    def take(self, count: int, now_ns: int) -> int | None:
        """Return the position of a count; None where it may be any, for too long has passed."""
        if self._last is None:
            rounds = math.ceil((self._low - count) / ROUND)
            if count + ROUND * rounds > self._high:
                rounds = 0  # beyond its range, wherever it is
            position = count + ROUND * rounds
        elif now_ns - self._at_ns >= self._longest_ns:
            return None
        else:
            position = self._last + (count - self._last + ROUND // 2) % ROUND - ROUND // 2
        self._last, self._at_ns = position, now_ns
        return position
