"""One of two sites of an operated rig: what people do at either is done at both.

Who lets go, holds, pauses or stops does so at once, whatever the other site does, and tells it.
Engaging needs both: each site begins once both are to engage, the slaves are in place, and each has
said that it is ready for where the other stands. An engagement is a session of the link: with its
end the keys and numbers of its packets end, so nothing of it can arrive in the next one.
"""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.columns import names
from tautwave.contracts import Row
from tautwave.controller.records import FINISHED, GUARD, LINK, OVERRUN
from tautwave.controller.run import forget_stop
from tautwave.controller.stops import stop_error
from tautwave.runtime.carrying.side import SideLoad, take_payload
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.commands import (
    EPISODE,
    HAND_BACK,
    PAYLOAD,
    TAKE_OVER,
    TOGGLE,
    WORDS,
    Order,
    unknown,
)
from tautwave.runtime.operate.engagement import drop_commands, end_session
from tautwave.runtime.operate.inbox import People
from tautwave.runtime.operate.journal import Entry, Journal
from tautwave.runtime.operate.operated import HOST_OR_SAMPLE, OPERATION
from tautwave.runtime.operate.rest.holds import spent_sentence
from tautwave.session.sites.accord import Accord, read_accord, settled
from tautwave.session.sites.control import SiteControl
from tautwave.sites.control import Session

REPEAT_S = 0.25
"""Time after which a site repeats what it is to do, while the other says something else [s]."""


class OperatedSite(SiteControl):
    """A `SiteControl` behind a table of states that both sites share.

    Parameters
    ----------
    people : People
        What people give and get at this site.
    given
        As for `SiteControl`.
    """

    master_rests = True
    loads: Sequence[SideLoad] = ()

    def __init__(self, people: People, *given: Any) -> None:
        self.inbox, self.lamps = people.inbox, people.lamps
        self.journal = Journal(people.task)
        self._accord = Accord()
        self._heard: Accord | None = None
        self._program, self._peers_program = secrets.token_hex(8), ""
        self._why = {"word": "", "source": "", "text": ""}
        self._renewing = self._suspect = False
        self._command = self._say_at = 0
        super().__init__(*given)
        self._engages = people.engage_at_start
        self._meeting.rest.free = self._resting = True
        self._meeting.rest.begin(seated=False)
        self._plain_columns = len(self.columns)
        self._repeat = max(1, round(REPEAT_S * 1e9 / self.run.period_ns))
        self.columns += names(OPERATION)

    @property
    def standing(self) -> st.Standing:
        """The state, and whether a fault has to be acknowledged."""
        return self._accord.standing(engaged=self._engaged)

    @property
    def engaged(self) -> bool:
        """Whether the coupling holds the axes."""
        return self._engaged

    # -- a slot -----------------------------------------------------------------------------

    def step(self, slot: int, skipped: int) -> bool:
        """Take commands of people here and there, then go on as a site."""
        self._slot, self._command = slot, 0
        if self.state.kind in HOST_OR_SAMPLE and self.standing.state != st.STOPPING:
            self._suspect = self._suspect or self.state.kind != OVERRUN
            self._forgive(st.FAULT)
        self._take_orders()
        going = super().step(slot, skipped)
        while news := self._meeting.rest.holds.news:
            self._event(st.FAULT, spent_sentence(self.names[news.pop()].name))
        if self._heard != self._accord and slot >= self._say_at:
            self._tell()
        return going or self.state.kind == FINISHED

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`."""
        super().fill(row, at)
        at += self._plain_columns
        row[at] = st.STATES.index(self.standing.state)
        row[at + 1] = self._command
        row[at + 2] = self.journal.engagements
        row[at + 3] = self.journal.running
        row[at + 4] = 1.0

    def stop_after(self, slot: int) -> None:
        """Ramp down from the next slot on, in whatever state the rig is."""
        super().stop_after(slot)
        now = self.standing
        if now.state != st.STOPPING:
            self._change(st.STOP, "", "", st.Standing(st.STOPPING, now.faulted))

    # -- commands and events ------------------------------------------------------------------

    def _take_orders(self) -> None:
        if self._engages:
            self._engages = False
            self._do(Order(st.ENGAGE, "", "rig"))
        for order in self.inbox.take(self._slot):
            self._do(order)
        if self.inbox.dead_men and st.follow(self.standing, st.RELEASED) is not None:
            for name in self.inbox.loose():
                self._event(st.RELEASED, f"{name}: the dead-man was released")

    def _do(self, order: Order) -> None:
        """Do what a person here asks for, or note why not."""
        now, word = self.standing, order.word
        if word == TOGGLE:
            word = st.CLUTCH if now.state == st.ENGAGED else st.ENGAGE
        self._command = WORDS.index(word) + 1 if word in WORDS else 0
        after = st.follow(now, word)
        why = self._refusal(word, order.argument)
        if word == PAYLOAD:
            text, refused = take_payload(self.loads, order.argument)
            self._note(word, order.source, text, refused=refused)
        elif why:
            self._note(word[:40], order.source, why, refused=True)
        elif word == EPISODE:
            self._mark(order.argument, order.source)
            message = {"episode": order.argument, "runs": self.journal.running > 0}
            self._line.send(send={**message, "source": order.source})
        elif word == st.REST and self._suspect and now.state == st.HOLDING:
            self.wants_reset = True
            self._note(word, order.source, "the devices are reset")
        elif after is not None:
            self._change(word, order.source, "", after, keep=now.state == st.CLUTCHED)
            self._note(word, order.source)

    def _refusal(self, word: str, argument: str) -> str:
        """Say why a command is refused here, '' if it is not."""
        if word not in WORDS:
            return unknown(word)
        if word == st.SCALE:
            return (
                "scale: not available with two sites: both ends would have "
                "to change in the same slot"
            )
        if word in (TAKE_OVER, HAND_BACK):
            return f"{word}: not available with two sites: no policy leads their master"
        if word == EPISODE:
            return self.journal.misplaced(argument, self.standing.state)
        resets = word == st.REST and self._suspect
        if not resets and st.follow(self.standing, word) is None:
            return st.refusal(self.standing, word)
        if word == st.ENGAGE and self._left and not self._renewing:
            return f"engage: {self.peer} is not connected: {self._left}"
        if word == st.ENGAGE and (loose := self.inbox.loose()):
            return f"engage: press the dead-man first: {', '.join(loose)}"
        return ""

    def _mark(self, argument: str, source: str) -> None:
        self._note(EPISODE, source, self.journal.mark(self._seconds(), argument))
        for lamp in self.lamps:
            lamp.shows(on=self.journal.running > 0)

    def _event(self, word: str, text: str = "") -> None:
        after = st.follow(self.standing, word)
        if after is not None:
            self._change(word, "controller", text, after)
            self._note(word, "controller", text)

    def _note(self, word: str, source: str, text: str = "", refused: bool = False) -> None:
        entry = Entry(self._seconds(), word, source, self.standing.state, text, refused)
        self.journal.note(entry)

    # -- what both sites are to do --------------------------------------------------------------

    def _change(
        self, word: str, source: str, text: str, after: st.Standing, *, keep: bool = False
    ) -> None:
        """Go over to what was asked for or found here, and tell the other site."""
        accord = self._accord.changed(self._side, after, keep=keep)
        self._why = {"word": word, "source": source, "text": text}
        self._tell(accord)
        self._enter(accord)

    def _tell(self, accord: Accord | None = None) -> None:
        """Tell the other site what this one is to do, and whether it should answer."""
        state = self._accord if accord is None else accord
        self._say_at = self._slot + self._repeat
        message = {"accord": state, "program": self._program, "asks": self._heard != state}
        self._line.send(send={**message, **self._why})

    def _hear(self, said: Mapping[str, Any]) -> None:
        """Take what the other site is to do, and settle what both are."""
        theirs = read_accord(said["accord"])
        if theirs is None:
            return
        if self._peers_program not in ("", said.get("program")):
            self._accord = self._accord.without(1 - self._side)
        self._peers_program, self._heard = str(said.get("program")), theirs
        accord, before = settled(self._accord, theirs), self.standing.state
        if accord != theirs or said.get("asks") is True:
            self._tell(accord)
        self._enter(accord)
        if self.standing.state != before:
            word, source, text = (str(said.get(key, "")) for key in ("word", "source", "text"))
            self._note(word[:40] or accord.state, f"{self.peer} {source}"[:32].strip(), text[:200])

    def _enter(self, accord: Accord) -> None:
        """Do at this site what both are to do; whoever lets go does it at once."""
        before, self._accord = self._accord, accord
        if self._engaged and accord.state not in (st.ALIGNING, st.STOPPING):
            self._let_go(accord.state)
        elif self._resting and before[:3] != accord[:3]:
            self._count_anew()
        if accord.state == st.ALIGNING and not self._engaged and accord.said != before.said:
            self._joined_at = self._slot
            self._meeting.meet(keep=accord.keep)
        elif accord.state == st.STOPPING:
            super().stop_after(self._slot)
        masters = self._side == 0 and accord.state == st.CLUTCHED
        self._meeting.rest.free = masters or accord.state == st.IDLE
        if self._suspect and not accord.faulted and accord.state != st.STOPPING:
            self.wants_reset = True

    def _let_go(self, why: str) -> None:
        """End the engagement, and its session with it; what it stored is booked as dissipated."""
        self._bank()
        end_session(self, self.loads)
        self._find_ends()
        self._engaged, self._held_from = False, -1
        self._resting, self._renewing = True, not self._left
        self._meeting.rest.begin(seated=True)
        if self._renewing:
            self._line.send(renew=why, of=self.sessions[-1]["id"])

    def _count_anew(self) -> None:
        """Begin the budgets of a new state at 0."""
        self._bank()
        self._resting = True
        self._meeting.rest.anew()

    # -- sessions -------------------------------------------------------------------------------

    def _wait(self, slot: int, skipped: int) -> None:
        """Rest, and engage once both are to, and can."""
        if self._left:
            self._count_down(slot)
        elif self._accord.state == st.ALIGNING:
            super()._wait(slot, skipped)

    def _meet(self, slot: int, skipped: int) -> Mapping[str, float] | None:
        """Hold until it is known where the other site stands, then go on."""
        met = self._side == 0 or self._meeting.heard
        return super()._meet(slot, skipped) if met else None

    def _begin(self, slot: int) -> None:
        super()._begin(slot)
        if self._engaged:
            self.journal.engagements += 1
            for load in self.loads:
                load.engage(self._meeting.met())
            self._note(st.ALIGNED, "controller")

    def _count_down(self, slot: int) -> None:
        """Stop where the other site has been away for too long; hold where it was not ready."""
        waited_ns = (slot - self._joined_at) * self.run.period_ns
        if self._engaged or self._left:
            super()._count_down(slot)
        elif waited_ns > self._limits.ready_ns:
            self._event(st.BLOCKED, self._meeting.hindrance or f"{self.peer} was not ready")

    def _renew(self, why: str) -> None:
        self._event(st.LOST, why)

    def _obey(self, message: Mapping[str, Any]) -> None:
        super()._obey(message)
        if not self._left:
            return
        if not self._renewing:
            self._event(st.LOST, f"{self.peer}: {self._left}")
        if self._held_from < 0 and not self._engaged:
            self._held_from = self._slot

    def _rejoin(self, session: Session) -> None:
        """Go on with another session; only after an engagement that people ended as before."""
        if not self._renewing:
            self._event(st.LOST, f"{self.peer} began anew")
        self._renewing, self._left, self._held_from = False, "", -1
        self._join(session)
        if self._accord.state == st.ALIGNING:
            self._meeting.meet(keep=self._accord.keep)
        self._heard = None
        self._tell()

    def _speak(self, said: Mapping[str, Any]) -> None:
        super()._speak({**said, "for": list(self._accord.said)})

    def _listen(self, said: Mapping[str, Any]) -> None:
        if "accord" in said:
            self._hear(said)
        elif "episode" in said:
            if said.get("runs") is not (self.journal.running > 0):
                source = f"{self.peer} {said.get('source', '')}"[:32]
                self._mark(str(said["episode"])[:200], source)
        elif said.get("for") in (None, list(self._accord.said)):
            super()._listen(said)

    # -- faults ---------------------------------------------------------------------------------

    def _settle(self, slot: int, end: int) -> None:
        """Turn what would end a run into a hold that a person may end."""
        kind = self.state.kind
        if kind in (FINISHED, LINK) or self.standing.state == st.STOPPING:
            return
        if not self._engaged and not self._resting:  # what was about to begin was banked
            self._resting = True
            self._meeting.rest.begin(seated=True)
        silent = self._engaged and "silences" in self.sessions[-1]
        owes = kind == GUARD and self.state.code in self._site.debts
        self._forgive(st.LOST if silent and owes else st.FAULT)

    def _forgive(self, word: str) -> None:
        error = stop_error(self.run, self.state, self.names, self.params, self.pairs, self.law)
        forget_stop(self.state, self.run.cycles)
        if self._engaged or not self._accord.faulted:
            self._event(word, str(error))

    def fault(self, slot: int, which: int, sentence: str) -> bool:
        """Hold on the fault of a device (-1: a bus) until a person has the devices reset."""
        if self.standing.state == st.STOPPING:
            return super().fault(slot, which, sentence)
        self._slot = slot
        self._suspect = True
        self.mark_dead(which)
        self._event(st.FAULT, sentence)
        return False

    def overrun(self, slot: int, skipped: int) -> None:
        """Note that the host stalled, unless the run is over by then."""
        if slot < self.state.end:
            super().overrun(slot, skipped)

    def devices_are(self, slot: int, refusal: str) -> None:
        """Take note of devices that were reset: all are enabled again, or why not."""
        self.wants_reset = False
        self._slot = slot
        if refusal:
            self._event(st.FAULT, f"the devices have not recovered: {refusal}")
            return
        self._suspect = False
        self.clear_dead()
        self._count_anew()
        self._meeting.rest.unseat()
        drop_commands(self)
        if self._accord.faulted:
            self._change(st.REST, "controller", "", st.Standing())
        self._note(st.REST, "controller", "the devices are back")
