"""The follower's slots go on side by side with the leader's, stretched by a little."""

from __future__ import annotations

from statistics import median

from tautwave.session.sites.endpoint import Endpoint

MAX_AHEADS = 31
"""Looks at both counts of slots, of which the median is taken."""

MAX_LATE_S = 0.1
"""Slots that are further behind [s] stay so: a clock stood still, as that of a machine asleep."""


class Pace:
    """Clocks of both sites, looked at now and then.

    Parameters
    ----------
    endpoint : Endpoint
        Whose clocks they are.
    period_ns : int
        One slot.
    follows : bool
        Whether this site's slots follow the other's.
    """

    def __init__(self, endpoint: Endpoint, period_ns: int, *, follows: bool) -> None:
        self._endpoint = endpoint
        self._period_ns = period_ns
        self._follows = follows
        self._aheads: list[float] = []
        self._phase: float | None = None
        self._residue = self.stretch = 0.0
        self.trimmed = 0.0
        """By how much all slots so far were longer together [s]."""
        self.ahead: float | None = None
        """By how many slots the own count is ahead of the other's in this session."""

    def join(self) -> None:
        """Begin a session: its slots are counted anew, maybe by another clock."""
        self._aheads, self.ahead = [], None
        self._phase, self.stretch = None, 0.0

    @property
    def shift(self) -> float:
        """Return `ahead` as time [s]."""
        return (self.ahead or 0.0) * self._period_ns * 1e-9

    def step(self, now_ns: int, slot: int) -> int:
        """Return by how much the next slot is longer [ns]; `slot` of the session, -1: none."""
        endpoint = self._endpoint
        looked = endpoint.look_at_clocks(now_ns)
        if looked and slot >= 0 and len(self._aheads) < MAX_AHEADS:
            self._aheads.append(endpoint.ahead(slot, now_ns, self._period_ns))
            self.ahead = median(self._aheads)
        if not self._follows:
            return 0
        if looked:
            phase = endpoint.offset + self.trimmed
            if self._phase is None or abs(phase - self._phase) > MAX_LATE_S:
                self._phase = phase
            self.stretch = endpoint.stretch(phase - self._phase)
        self._residue += self.stretch * self._period_ns
        trim_ns = int(self._residue)
        self._residue -= trim_ns
        self.trimmed += trim_ns * 1e-9
        return trim_ns
