"""Histograms of lateness, period and compute time, kept without allocating while the loop runs."""

from __future__ import annotations

from array import array

BINS = 20_000


class Histogram:
    """Counts of durations in bins of a microsecond; the last bin holds everything longer."""

    __slots__ = ("_counts", "_greatest_ns", "_total")

    def __init__(self) -> None:
        self._counts = array("q", bytes(8 * (BINS + 1)))
        self._greatest_ns = 0
        self._total = 0

    def add(self, duration_ns: int) -> None:
        """Count one duration [ns]; negative ones count as 0."""
        if duration_ns > self._greatest_ns:
            self._greatest_ns = duration_ns
        index = duration_ns // 1000
        self._counts[index if 0 <= index < BINS else BINS if index > 0 else 0] += 1
        self._total += 1

    def add_all(self, other: Histogram) -> None:
        """Add the counts of another histogram."""
        for index, count in enumerate(other._counts):
            self._counts[index] += count
        self._total += other._total
        self._greatest_ns = max(self._greatest_ns, other._greatest_ns)

    def quantile_us(self, share: float) -> float:
        """Return the upper edge [us] of the bin that contains the quantile `share`."""
        wanted = share * self._total
        seen = 0
        for index, count in enumerate(self._counts):
            seen += count
            if count and seen >= wanted:
                return min(index + 1.0, self._greatest_ns / 1000.0)
        return self._greatest_ns / 1000.0

    def summary(self) -> dict[str, float]:
        """Return p50, p99, p999 and max [us]."""
        return {
            "p50": self.quantile_us(0.5),
            "p99": self.quantile_us(0.99),
            "p999": self.quantile_us(0.999),
            "max": self._greatest_ns / 1000.0,
        }
