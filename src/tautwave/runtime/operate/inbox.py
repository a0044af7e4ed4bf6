"""What has come for an operated rig: commands of all sources, and dead-men that are not held."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from tautwave.runtime.operate.commands import DeadMan, Lamp, Order, Source, in_full
from tautwave.runtime.operate.led import LedMasters


class Inbox:
    """Everything that people give a rig.

    Parameters
    ----------
    period_ns, look : int
        One slot, and the slots between two looks at the live sources.
    scripts, live : sequence of Source
        Looked at in every slot, and now and then.
    dead_men : sequence of DeadMan
        All have to be held while aligning and engaged.
    """

    def __init__(
        self,
        period_ns: int,
        look: int,
        scripts: Sequence[Source],
        live: Sequence[Source],
        dead_men: Sequence[DeadMan],
    ) -> None:
        self._period_ns, self._look = period_ns, look
        self._scripts, self._live = scripts, live
        self._next_look = 0
        self.dead_men = dead_men

    def take(self, slot: int) -> Iterator[Order]:
        """Give the commands that are due."""
        now_ns = slot * self._period_ns
        for source in self._scripts:
            yield from map(in_full, source.take(now_ns))
        if slot >= self._next_look:
            self._next_look = slot + self._look
            for source in self._live:
                yield from map(in_full, source.take(now_ns))

    def loose(self) -> list[str]:
        """Return the names of the dead-man switches that are not held."""
        return [one.name for one in self.dead_men if not one.held()]


class People(NamedTuple):
    """What people give a rig and get from it: commands and dead-men, lamps.

    `engage_at_start`: the rig gives itself that command. `task`: of episodes that name none.
    `led`: its masters, if a policy leads them.
    """

    inbox: Inbox
    lamps: Sequence[Lamp]
    engage_at_start: bool
    task: str = ""
    led: LedMasters | None = None
