"""Time for the loop: the machine's monotonic clock, or one that runs as fast as it computes.

Drivers wait only through a clock. No code but this module sleeps.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from typing import Any

LAG_NS = 50_000_000
"""How far a `PacedClock` may be behind before it gives up catching up [ns]."""


class MonotonicClock:
    """CLOCK_MONOTONIC with absolute deadlines.

    Linux wakes late by its timer slack and scheduling; no spinning hides it.
    """

    real = True

    def now_ns(self) -> int:
        """Return the time [ns]."""
        return time.monotonic_ns()

    def sleep_until(self, deadline_ns: int) -> None:
        """Sleep until `deadline_ns`; return at once if it has passed."""
        left = deadline_ns - time.monotonic_ns()
        if left > 0:
            # CPython sleeps with clock_nanosleep(TIMER_ABSTIME), signals included (PEP 475).
            time.sleep(left * 1e-9)  # noqa: TID251  the clock is the one place that sleeps

    def wait(self, transport: Any, deadline_ns: int) -> bool:
        """Wait in the kernel until `transport.fileno()` is readable or the deadline passes.

        A transport simulated in this process is instead advanced to the present, with sleeps until
        its next event.
        """
        if hasattr(transport, "advance"):
            return self._run(transport, deadline_ns)
        left = deadline_ns - time.monotonic_ns()
        ready, _, _ = select.select([transport], [], [], max(0.0, left * 1e-9))
        return bool(ready)

    def _run(self, transport: Any, deadline_ns: int) -> bool:
        while True:
            now = time.monotonic_ns()
            transport.advance(now)
            if transport.readable():
                return True
            if now >= deadline_ns:
                return False
            event = transport.next_event_ns()
            self.sleep_until(deadline_ns if event is None else min(event, deadline_ns))


class FakeClock:
    """A clock that jumps: neither computing nor sleeping takes time.

    Parameters
    ----------
    start_ns : int
        Time at the start [ns].
    oversleep : callable, optional
        Called at each sleep with its deadline; returns how much later the sleeper wakes [ns].
        Seeded overruns of a simulation come from here.
    """

    real = False

    def __init__(self, start_ns: int = 0, oversleep: Callable[[int], int] | None = None) -> None:
        self._now_ns = start_ns
        self._oversleep = oversleep

    def now_ns(self) -> int:
        """Return the time [ns]."""
        return self._now_ns

    def sleep_until(self, deadline_ns: int) -> None:
        """Jump to `deadline_ns`, plus what `oversleep` returns."""
        if deadline_ns > self._now_ns:
            self._now_ns = deadline_ns
        if self._oversleep is not None:
            self._now_ns += self._oversleep(deadline_ns)

    def wait(self, transport: Any, deadline_ns: int) -> bool:
        """Advance an in-memory transport, event by event, until it has data or time is up.

        `transport` offers `next_event_ns()` (or None), `advance(to_ns)` and `readable()`.
        """
        while not transport.readable():
            event = transport.next_event_ns()
            if event is None or event > deadline_ns:
                self._now_ns = max(self._now_ns, deadline_ns)
                transport.advance(self._now_ns)
                return bool(transport.readable())
            self._now_ns = max(self._now_ns, event)
            transport.advance(self._now_ns)
        return True


class PacedClock(FakeClock):
    """Simulated time that passes as fast as real time, and waits for a host that is late.

    For what is simulated in this process alone, and watched. Every slot is run: what a host missed
    is made up at once, and beyond `LAG_NS` time has stood still. So no effort is held over slots in
    which nobody was there, which would throw a light device away.
    """

    real = True

    def __init__(self) -> None:
        super().__init__(time.monotonic_ns())
        self._behind_ns: int | None = None  # real time, from the first sleep on
        self._stood_ns = self._stops = 0

    def sleep_until(self, deadline_ns: int) -> None:
        """Sleep until `deadline_ns`, which it is then, however late."""
        super().sleep_until(deadline_ns)
        now = time.monotonic_ns()
        if self._behind_ns is None:
            self._behind_ns = now - self._now_ns
        left = self._now_ns + self._behind_ns - now
        if left > 0:
            time.sleep(left * 1e-9)  # noqa: TID251  the clock is the one place that sleeps
        elif -left > LAG_NS:
            self._behind_ns -= left
            self._stood_ns -= left
            self._stops += 1

    def sentence(self) -> str:
        """Return how it kept up with real time."""
        if not self._stops:
            return "simulated time kept up with real time: no slot was skipped"
        times = f"{self._stops} piece{'s'[: self._stops != 1]}"
        waited = f"{1e-9 * self._stood_ns:.2g} s for this machine, in {times}"
        return f"simulated time waited {waited}: no slot was skipped"
