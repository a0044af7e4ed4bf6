"""Episodes by a plan: as many as wanted, each of its length, with time to reset between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tautwave.runtime.operate.commands import EPISODE, Order
from tautwave.runtime.operate.states import ENGAGED, STOP

LOOK_NS = 10_000_000
SOURCE = "plan"


class EpisodePlan:
    """Begins and ends the episodes of an operated rig, and ends the run after the last one.

    A source of commands like any other: people may end an episode before its time, begin the next
    one before the time to reset is over, and have the last one again.

    Parameters
    ----------
    count : int
        Episodes to keep; those that were recorded again do not count.
    episode_s, reset_s : float
        Length of an episode, and pause after each [s].
    name : str
        Of the episodes.
    """

    def __init__(self, count: int, episode_s: float, reset_s: float, name: str) -> None:
        self._count = count
        self._episode_s, self._reset_s = episode_s, reset_s
        self._name = name
        self._control: Any = None
        self._next = 0
        self._over = False

    def sees(self, control: Any) -> None:
        """Take the rig's controller."""
        self._control = control

    def take(self, now_ns: int) -> Sequence[Order]:
        """Return the command that is due, if any."""
        if self._control is None or self._over or now_ns < self._next:
            return ()
        self._next = now_ns + LOOK_NS
        journal, now = self._control.journal, 1e-9 * now_ns
        last = journal.episodes[-1] if journal.episodes else None
        if journal.running:
            assert last is not None
            return [Order(EPISODE, "", SOURCE)] if now >= last.begin_s + self._episode_s else ()
        if last is not None and now < last.end_s + self._reset_s:
            return ()
        if sum(not one.discarded for one in journal.episodes) >= self._count:
            self._over = True
            return [Order(STOP, "", SOURCE)]
        engaged = self._control.standing.state == ENGAGED
        return [Order(EPISODE, self._name, SOURCE)] if engaged else ()
