"""Before a session: where both sites' axes stand, by which offsets, and whether both are ready.

The master says where it stands, and again where it has moved since. The slave goes to where that
wants it, unless it is there, and says for which place of the master's it is ready. The master
begins if it still stands there. A pair whose rig has no offset keeps, over all sessions of a run,
the one with which it first engaged; a site that is started anew gets it from the other.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.controller.pair import mismatch
from tautwave.runtime.control import CoupledControl
from tautwave.session.sites.agreed import positions
from tautwave.session.sites.rest import Approach, Rest

SLACK = 0.5
"""Share of the reach by which a master may have moved since it said where it stands."""

SAY_SLOTS = 20
"""At least between two words of where it stands."""


class Said(NamedTuple):
    """Where a site stands, for which place of the other's it is ready, and offsets it knows.

    All by pair [rad or m].
    """

    at: Mapping[str, float]
    to: Mapping[str, float] | None
    offsets: Mapping[str, float]


def read_said(said: Any, names: Sequence[str]) -> Said | None:
    """Return what the other site said, None if it is not valid."""
    if not isinstance(said, Mapping):
        return None
    at, known = positions(said.get("at"), names), said.get("offsets")
    if at is None or not isinstance(known, Mapping):
        return None
    offsets = positions(known, [name for name in names if name in known])
    return None if offsets is None else Said(at, positions(said.get("to"), names), offsets)


class Meeting:
    """One site's part in beginning sessions.

    Parameters
    ----------
    control : CoupledControl
        Whose pairs they are.
    side : int
        0 master, 1 slave.
    approach : Approach
        What brings slaves into place.
    say : callable
        Tells the other site something.
    """

    def __init__(
        self,
        control: CoupledControl,
        side: int,
        approach: Approach,
        say: Callable[[Mapping[str, Any]], None],
    ) -> None:
        self._control = control
        self._side = side
        self._approach = approach
        self._say = say
        self._names = control.pair_names
        self._pairs = list(control.pairs)
        self._own = [(q.master, q.slave)[side] for q in control.pairs]
        self.offsets: dict[str, float] = {}
        """Of pairs whose rig gives none, once known [rad or m, slave]."""
        self._keeps = False
        self.rest = Rest(control, self._own, approach)
        self.hindrance = ""
        """Why a slave is not in its place, as a sentence."""
        self.join()

    def join(self) -> None:
        """Begin to meet for another session."""
        self._said: Said | None = None
        self._peer: Said | None = None
        self._began: Mapping[str, float] | None = None
        self._said_at = -SAY_SLOTS
        self._goal: Mapping[str, float] | None = None
        self.rest.release()

    def meet(self, *, keep: bool) -> None:
        """Begin to meet as if for the first time: at the rig's offsets, or those there are."""
        self.join()
        self.offsets, self.hindrance, self._keeps = {}, "", keep
        self._control.pairs = [q._replace(at_engage=q.at_engage or keep) for q in self._pairs]

    def hear(self, said: Mapping[str, Any]) -> None:
        """Take what the other site says of where it stands, of what hinders it, of its begin."""
        if "stands" in said:
            self._peer = read_said(said["stands"], self._names) or self._peer
        elif "hindered" in said:
            self.hindrance = str(said["hindered"])[:200]
        elif "began" in said:
            began = read_said(said["began"], self._names)
            if began is not None:
                self._began = began.at
                self.offsets = {**began.offsets, **self.offsets}

    def known(self) -> list[int]:
        """Return the pairs whose slaves have a place to be in."""
        if self._keeps:
            return []
        theirs = {} if self._peer is None else self._peer.offsets
        have, pulls = {*self._approach.offsets, *self.offsets, *theirs}, self._approach.pulls
        return [k for k, name in enumerate(self._names) if name in have and k in pulls]

    def arrived(self, slot: int) -> bool:
        """Go on towards the goal; return whether all is in place, and rests."""
        there = self.rest.arrived(slot)
        if self._side == 1 and self.rest.hindrance != self.hindrance:
            self.hindrance = self.rest.hindrance
            self._say({"hindered": self.hindrance})
        return there

    def settled(self, slot: int) -> Mapping[str, float] | None:
        """Go on; return where the other site's axes stand [rad or m] if this one is to begin."""
        at = self._places()
        return self._lead(slot, at) if self._side == 0 else self._follow(slot, at)

    @property
    def heard(self) -> bool:
        """Whether the other site has said where it stands."""
        return self._peer is not None

    def new_goal(self) -> bool:
        """Return whether the master stands elsewhere than it did so far; the slave looks there."""
        peer = self._peer
        if self._side == 0 or peer is None or peer.at == self._goal:
            return False
        self._goal = peer.at
        self.offsets = {**peer.offsets, **self.offsets}
        self._keep_offsets()
        return True

    def is_astray(self) -> bool:
        """Return whether a slave is further from its place than it has to be brought."""
        goal, pulls = self._goal, self._approach.pulls
        return goal is not None and any(
            math.fabs(self._gap(k, goal)) > pulls[k].reach for k in self.known()
        )

    def aim(self, slot: int) -> None:
        """Bring the slaves into place."""
        goal = self._goal
        assert goal is not None
        here = self._places()
        self.rest.aim({k: here[self._names[k]] - self._gap(k, goal) for k in self.known()}, slot)

    def out_of_place(self, far: Mapping[str, float]) -> str:
        """Return which slaves are too far from their places to begin, nothing if none is."""
        if self._side == 0:
            return ""
        moved = [
            self._names[k]
            for k in self.known()
            if math.fabs(self._gap(k, far)) > self._approach.tolerances[k]
        ]
        return f"{', '.join(moved)} moved before the session began" if moved else ""

    def begun(self) -> Mapping[str, float]:
        """Say that this site has begun; return where [rad or m]."""
        at = self._places()
        if self._side == 1:
            states = self._control.states
            for name, q, c in zip(self._names, self._pairs, states, strict=True):
                if q.at_engage:
                    self.offsets.setdefault(name, c.offset)
        self._say({"began": {"at": at, "to": None, "offsets": self.offsets}})
        return at

    def met(self) -> dict[str, float]:
        """Return the offsets of the session that has begun [rad or m, slave]."""
        return {name: c.offset for name, c in zip(self._names, self._control.states, strict=True)}

    def _places(self) -> dict[str, float]:
        samples = self._control.samples
        return {name: samples[i].position for name, i in zip(self._names, self._own, strict=True)}

    def _lead(self, slot: int, at: Mapping[str, float]) -> Mapping[str, float] | None:
        heard, peer = self._said, self._peer
        if heard is None or (slot - self._said_at >= SAY_SLOTS and self._moved(heard.at, at)):
            self._tell(slot, Said(at, None, self.offsets))
        elif peer is not None and peer.to == heard.at:
            return peer.at
        return None

    def _moved(self, since: Mapping[str, float], at: Mapping[str, float]) -> bool:
        pulls, pairs = self._approach.pulls, self._pairs
        return any(
            math.fabs(pairs[k].ratio * (at[name] - since[name])) > SLACK * pulls[k].reach
            for k, name in enumerate(self._names)
            if k in self.known()
        )

    def _follow(self, slot: int, at: Mapping[str, float]) -> Mapping[str, float] | None:
        heard = self._said
        if heard is None:
            self._tell(slot, Said(at, None, self.offsets))
        elif self._goal is not None and heard.to != self._goal:
            self._tell(slot, Said(at, self._goal, self.offsets))
        return self._began

    def _tell(self, slot: int, said: Said) -> None:
        self._said, self._said_at = said, slot
        self._say({"stands": said._asdict()})

    def _keep_offsets(self) -> None:
        """Give pairs without an offset of their own that of the run."""
        if self._keeps:
            return
        kept = []
        for k, (name, q) in enumerate(zip(self._names, self._pairs, strict=True)):
            if q.at_engage and name in self.offsets and k in self._approach.pulls:
                q = q._replace(
                    at_engage=False, offset=self.offsets[name],
                    tolerance=self._approach.tolerances[k],
                )  # fmt: skip
            kept.append(q)
        self._control.pairs = kept

    def _gap(self, k: int, far: Mapping[str, float]) -> float:
        """Return how far a slave is from its place [rad or m]."""
        q = self._control.pairs[k]
        here = self._control.samples[self._own[k]].position
        return mismatch(q, far[self._names[k]], here, q.offset)
