"""Actions of a simulated line at times of its own, in the order of their times [ns]."""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable


class Schedule:
    """A line's time, and what is still to happen on it; what is due at one time, first come."""

    def __init__(self) -> None:
        self._now_ns = 0
        self._events: list[tuple[int, int, Callable[[], None]]] = []
        self._count = itertools.count()

    def call_at(self, time_ns: int, action: Callable[[], None]) -> None:
        """Have `action` called when the line's time reaches `time_ns`."""
        heapq.heappush(self._events, (time_ns, next(self._count), action))

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself [ns]."""
        return self._events[0][0] if self._events else None

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        while self._events and self._events[0][0] <= to_ns:
            time_ns, _, action = heapq.heappop(self._events)
            self._now_ns = max(self._now_ns, time_ns)
            action()
        self._now_ns = max(self._now_ns, to_ns)
