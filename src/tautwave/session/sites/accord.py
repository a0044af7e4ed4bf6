"""What two sites of an operated rig are to do together, and how each gets to know it.

Each site has its own idea of it, which a person there changes at once, and sends it to the other.
An idea that knew of all changes of the other one supersedes it; of two that did not know of each
other the calmer counts, at both sites, whatever comes first. So whoever lets go is never overruled
by an `engage` that did not know of it, and both agree once nothing is under way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from tautwave.runtime.operate.states import (
    ALIGNING,
    CLUTCHED,
    ENGAGED,
    HOLDING,
    IDLE,
    STOPPING,
    Standing,
)

CALMEST = (STOPPING, HOLDING, CLUTCHED, IDLE, ALIGNING)
"""What both may be to do, the calmest first; `aligning` goes on as engaged."""


class Accord(NamedTuple):
    """What both sites are to do, as one of them knows it.

    `keep`: to engage at the present offset; `said`: how many changes of the master's and of the
    slave's it knows of.
    """

    state: str = IDLE
    faulted: bool = False
    keep: bool = False
    said: tuple[int, int] = (0, 0)

    def standing(self, *, engaged: bool) -> Standing:
        """Return the state of a site, which is `engaged` or not."""
        aligned = engaged and self.state == ALIGNING
        return Standing(ENGAGED if aligned else self.state, self.faulted)

    def changed(self, side: int, after: Standing, *, keep: bool = False) -> Accord:
        """Return what a change at a side (0 master, 1 slave) makes of it."""
        one, two = self.said
        counts = (one + 1, two) if side == 0 else (one, two + 1)
        state = ALIGNING if after.state == ENGAGED else after.state
        return Accord(state, after.faulted, keep, counts)

    def without(self, side: int) -> Accord:
        """Return what is known once a side's program was started anew and counts from 0."""
        one, two = self.said
        return self._replace(said=(0, two) if side == 0 else (one, 0))


def knows(one: Accord, other: Accord) -> bool:
    """Return whether one knows of every change that the other knows of."""
    return one.said[0] >= other.said[0] and one.said[1] >= other.said[1]


def settled(one: Accord, other: Accord) -> Accord:
    """Return what follows from two ideas: the one that knew of the other's, or the calmer."""
    first, second = knows(one, other), knows(other, one)
    if first != second:
        return one if first else other
    counts = max(one.said[0], other.said[0]), max(one.said[1], other.said[1])
    calm = min(one, other, key=_unrest)
    return calm._replace(said=counts, faulted=one.faulted or other.faulted)


def _unrest(one: Accord) -> tuple[int, bool]:
    """Return how far from rest an idea is: its state, and whether slaves may be moved first."""
    return CALMEST.index(one.state), not one.keep


def read_accord(said: Any) -> Accord | None:
    """Return what the other site said, None if it is not valid."""
    match said:
        case [str(state), bool(faulted), bool(keep), [int(one), int(two)]] if (
            state in CALMEST and min(one, two) >= 0
        ):
            return Accord(state, faulted, keep, (one, two))
    return None
