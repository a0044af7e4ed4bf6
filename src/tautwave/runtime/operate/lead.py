"""Programs that lead a rig: actions for its virtual hands, and a hold where they stop coming."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from tautwave.laws.lead import LeadParams, lead_step
from tautwave.runtime.operate.commands import LEAD, Order, Source

LOOK_S = 0.004
"""From one look for a pointer's actions to the next; screens show 60 to 120 pictures a second."""

MISSED_FRAMES = 3
"""Frames without an action, after which the rig holds."""


class Lead:
    """Reference of one virtual hand. Before its first action it holds where it stands.

    Parameters
    ----------
    params : LeadParams
        Limits.
    start : float
        Where it begins [rad or m].
    period : float
        One slot of its axis [s].
    """

    def __init__(self, params: LeadParams, start: float, period: float) -> None:
        self._params, self._period = params, period
        self._reference = self._goal = start
        self._left = 0.0
        self._age: float | None = None

    def want(self, position: float) -> None:
        """Take an action [rad or m]."""
        self._goal, self._left, self._age = position, self._params.frame, 0.0

    @property
    def stale(self) -> bool:
        """Whether actions have stopped coming."""
        limit = (MISSED_FRAMES + 1e-6) * self._params.frame
        return self._age is not None and self._age > limit

    def aim(self, place: float) -> tuple[float, float]:
        """Return the reference at this slot and its rate until the next; `place`: the device's."""
        before = self._reference
        self._reference = lead_step(
            self._params, before, self._goal, self._left, place, self._period
        )
        self._left -= self._period
        if self._age is not None:
            self._age += self._period
        return before, (self._reference - before) / self._period


class Pointed(Lead):
    """Reference of a hand that a page's pointer leads; it lets go when the pointer is silent.

    Before the first word it holds where it stands, or grains would throw it out of its range
    before a person has opened the page. Where it has let go, it is an end stop at both ends of the
    pointer's range: nothing else would keep grains from throwing a bar without weight away.

    It is passive: a spring of bounded force to the pointer's place, or springs that push from the
    ends of the range inwards, and the grip's mass and damper.

    Parameters
    ----------
    params, start, period
        As of `Lead`.
    timeout : float
        Time without word of the pointer after which it lets go [s].
    """

    def __init__(self, params: LeadParams, start: float, period: float, timeout: float) -> None:
        super().__init__(params, start, period)
        self.look: Callable[[], object] = int  # nobody is there
        self._timeout = timeout
        self._looks = max(1, round(LOOK_S / period))
        self._led = False
        self._slot = 0

    @property
    def range(self) -> tuple[float, float]:
        """Where the pointer may lead it [rad or m]."""
        return self._params.low, self._params.high

    @property
    def stale(self) -> bool:
        """Whether there is no pointer, or it is silent."""
        return self._age is None or self._age > self._timeout

    def let_go(self) -> None:
        """Wait for the next action."""
        self._age = None

    def want(self, position: float) -> None:
        """Take a place of the pointer [rad or m]."""
        self._led = True
        super().want(position)

    def aim(self, place: float) -> tuple[float, float]:
        """Return the reference at this slot and its rate; without a pointer the device's place."""
        if self._slot % self._looks == 0:
            self.look()
        self._slot += 1
        if not (self._led and self.stale):
            return super().aim(place)
        low, high = self.range
        self._reference = self._goal = max(low, min(high, place))
        return self._reference, 0.0


class Leads:
    """All virtual hands of a rig, by pair; as a dead-man, it is let go when actions stop coming."""

    name = "policy"

    def __init__(self, leads: Mapping[str, Lead]) -> None:
        self._leads = leads

    def held(self) -> bool:
        """Return whether every hand that was led still is."""
        return not any(lead.stale for lead in self._leads.values())

    def obey(self, argument: str) -> bool:
        """Take actions such as `wrist=0.3 slide=0.02`, all or none; return whether they were."""
        wanted = {}
        for word in argument.split():
            name, _, text = word.partition("=")
            try:
                value = float(text)
            except ValueError:
                value = math.nan
            if name not in self._leads or not math.isfinite(value):
                return False
            wanted[name] = value
        for name, value in wanted.items():
            self._leads[name].want(value)
        return bool(wanted)


class Leading:
    """A source of commands whose actions go to the hands that they lead; the others are passed on.

    Parameters
    ----------
    source : Source
        Of the commands.
    leads : Leads
        The hands.
    """

    def __init__(self, source: Source, leads: Leads) -> None:
        self._source, self._leads = source, leads

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return the commands that have come; of actions only those that are wrong."""
        return [
            order
            for order in self._source.take(now_ns)
            if order.word != LEAD or not self._leads.obey(order.argument)
        ]
