"""The controller of one of two sites: its end of every pair, and when to engage, hold and stop.

The other end of a pair is a stand-in that is never sampled; what leaves and arrives passes through
the link's part of the table, and this module carries it to and from the network. Nothing that comes
from there moves a motor but through the receivers.

    waiting    a session is there or not; commands are zero, a hold's damping, or bring slaves into
               place
    engaged    the end runs
    holding    nothing came for too long, or the other site said that it stops: certified damping

From holding it goes back to engaged if packets of the same session come, and the motion that was
missed is within bounds; else a new session begins, once slaves that are too far from their places
have been brought there, with its own ramp, and nothing stored crosses. A site that is not back in
time is lost: a passive stop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from tautwave.columns import names
from tautwave.contracts import Row
from tautwave.controller.axis import is_calm
from tautwave.controller.records import FINISHED, GUARD, LINK
from tautwave.controller.run import begin_stop, forget_stop
from tautwave.controller.steps import SiteLaw
from tautwave.errors import LinkError, TautwaveError
from tautwave.link.columns import LINK_COLUMNS
from tautwave.link.packet import Line
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.operate.engagement import end_session
from tautwave.session.sites.agreed import SiteLimits, lost_words, unready_words
from tautwave.session.sites.desk_line import DeskLine, keep_note, session_of
from tautwave.session.sites.endpoint import Endpoint
from tautwave.session.sites.meeting import Meeting
from tautwave.session.sites.pace import Pace
from tautwave.session.sites.rest import Approach
from tautwave.session.sites.rows import SIDES, SiteRows
from tautwave.sites.control import Session

GREETING_SLOTS = 20


class SiteControl(CoupledControl):
    """One end of every pair of a `CoupledControl`, joined to the other site.

    Parameters
    ----------
    given : CoupledControl
        Of the half rig: its own axes come first.
    site : SiteLaw
        Its law at this site.
    side : int
        0 master, 1 slave.
    limits : SiteLimits
        When to hold and to stop.
    approach : Approach
        What brings slaves into place.
    endpoint, line : Endpoint, DeskLine
        To the other site; `line` has brought `first`, the first session.
    peer : tuple
        Where the other site's data plane is; None where it dials.
    now_ns : callable
        The loop's clock [ns].
    """

    master_rests = False
    """Whether a master's axes rest between sessions, too."""

    def __init__(
        self,
        given: CoupledControl,
        site: SiteLaw,
        side: int,
        limits: SiteLimits,
        approach: Approach,
        endpoint: Endpoint,
        line: DeskLine,
        first: Session,
        peer: tuple[str, int] | None,
        now_ns: Callable[[], int],
    ) -> None:
        pairs = [q._replace(link=site.patient(q.link)) for q in given.pairs]
        super().__init__(
            given.run, given.names, given.params, given.pair_names, pairs, given.table, site.law
        )
        self._site = site
        self._now_ns = now_ns
        self._side = side
        self._limits = limits
        self._endpoint = endpoint
        self._line = line
        self._where = peer
        self._find_ends()
        self._own = [(q.master, q.slave)[side] for q in self.pairs]
        self._far = [(q.slave, q.master)[side] for q in self.pairs]
        self._rows = SiteRows(self.columns, SIDES[side])
        self._meeting = Meeting(self, side, approach, self._speak)
        self._pace = Pace(endpoint, self.run.period_ns, follows=limits.follows)
        self._measured = self._resting = False
        self._rests = self.master_rests or side == 1
        books = self._meeting.rest.columns(SIDES[side]) if self._rests else []
        self.columns = [*self._rows.names, *names(LINK_COLUMNS), *books]
        self._slot = 0
        self._engaged = False
        self._held_from = -1
        self._left = ""
        self._gone = ""
        self.sessions: list[dict[str, Any]] = []
        self.ended = ""
        """Why the other site took its leave, as a sentence; empty unless it did."""
        self.peer = first.peer
        self._join(first)

    # -- a slot -----------------------------------------------------------------------------

    def step(self, slot: int, skipped: int) -> bool:
        """Take what came, decide whether to run, run the own ends, and send what leaves."""
        self._slot = slot
        now = self._now_ns()
        came = self._endpoint.receive(self._take if self._engaged else None)
        while (message := self._line.poll()) is not None:
            self._obey(message)
        if self._resting:
            self._meeting.rest.sense(slot, skipped)
        if self.state.kind == FINISHED and not self.ended:
            if not self._engaged:
                self._wait(slot, skipped)
            else:
                self._watch(slot, skipped, came)
        engaging = not self._engaged and self.samples[self._far[0]].valid
        end = self.state.end
        going = True
        if engaging and (self._measured or self._resting):
            self._bank()
        if self._resting:
            self._meeting.rest.send(slot)
        else:
            going = super().step(slot, skipped)
        self._settle(slot, end)
        if engaging:
            self._begin(slot)
        if self._engaged and self._link_slot() >= 0:  # the first exchange is one slot later
            self._endpoint.send(*self._say())
        elif self._where is not None and slot % GREETING_SLOTS == 0:
            self._endpoint.greet()
        if self.state.kind != FINISHED or slot + 1 >= self.state.end:
            self._line.leave(self.error())
        self.trim_ns = self._pace.step(now, self._link_slot())
        if self._pace.ahead is not None:
            self.sessions[-1]["slots_ahead"] = self._pace.ahead
        return going

    def fill(self, row: Row, at: int) -> None:
        """Write the columns of the own ends and of the link at index `at`."""
        super().fill(self._rows.whole, 0)
        at = self._rows.fill(row, at, self._pace.shift)
        row[at] = float(len(self.sessions))
        row[at + 1] = float(self._link_slot())
        row[at + 2] = (self._now_ns() - self._endpoint.heard_ns) * 1e-9
        row[at + 3] = 1.0 if self._held_from >= 0 else 0.0
        row[at + 4] = self._endpoint.delay
        row[at + 5] = 1.0 if self._resting else 0.0
        at += len(LINK_COLUMNS)
        if self._rests:
            self._meeting.rest.fill(row, at)

    def error(self) -> TautwaveError | None:
        """Return the reason to end the run early, or None."""
        return LinkError(self._gone) if self.state.kind == LINK else super().error()

    def _take(self, slot: int, lines: Sequence[Line]) -> None:
        """Take a packet that came, a line for each pair."""
        for (end, k, _), line in zip(self._ends, lines, strict=True):
            self._site.take(end, k, self.table, slot, line)

    def _say(self) -> tuple[int, tuple[Line, ...]]:
        """Return the last slot and its lines."""
        spoken = [self._site.said(far, self.table) for _, _, far in self._ends]
        return spoken[0][0], tuple(line for _, line in spoken)

    # -- sessions ---------------------------------------------------------------------------

    def _join(self, session: Session) -> None:
        self._endpoint.join(session, self._where)
        self._engaged = False
        self._meeting.join()
        self._pace.join()
        self._joined_at = self._slot
        self.sessions.append({"id": session.id.hex(), "joined_s": self._seconds()})

    def _find_ends(self) -> None:
        """Find the own end of each pair: its state, its constants, those of the far one."""
        self._ends = []
        for state, q in zip(self.states, self.pairs, strict=True):
            (one, two), k = self._site.ends(state.link), q.link
            both = (one, k.master, k.slave), (two, k.slave, k.master)
            self._ends.append(both[self._side])

    def _bank(self) -> None:
        """Carry the accounts of what ends now: a session and its hold, or a rest."""
        super().fill(self._rows.whole, 0)
        self._rows.end_session()
        self._meeting.rest.end()
        self._resting = False

    def _wait(self, slot: int, skipped: int) -> None:
        """Engage as soon as both sites can; give up after a while."""
        samples, axes, params = self.samples, self.axes, self.params
        calm = skipped == 0 and all(
            samples[i].valid and is_calm(axes[i], params[i], self.run.arm_share) for i in self._own
        )
        begun = self._meet(slot, skipped) if calm and not self._left else None
        if self._left:
            self._meeting.rest.release()
        if begun is None:
            self._count_down(slot)
            return
        for name, far in zip(self.pair_names, self._far, strict=True):
            samples[far].position, samples[far].valid = begun[name], True
        for state in self.states:
            self._site.begin(state.link)
        for s in axes:
            s.stopping = False
        self.state.armed_at = -1

    def _meet(self, slot: int, skipped: int) -> Mapping[str, float] | None:
        """Bring slaves into place; return where the other site's axes stand if this one begins."""
        meeting = self._meeting
        if meeting.new_goal() and (self._resting or meeting.is_astray()):
            if not self._resting:
                self._rest(slot, skipped)
            meeting.aim(slot)
        if self._resting and not meeting.arrived(slot):
            return None
        begun = meeting.settled(slot)
        if begun is not None and (why := meeting.out_of_place(begun)):
            self._renew(why)
            return None
        return begun

    def _rest(self, slot: int, skipped: int) -> None:
        """Let go of what the coupling stored, and have the axes rest."""
        self._bank()
        end_session(self)
        self._find_ends()
        self._resting = True
        self._meeting.rest.begin(seated=self._measured)
        self._meeting.rest.sense(slot, skipped)

    def _begin(self, slot: int) -> None:
        """Look whether the ends have begun, and say so."""
        for far in self._far:
            self.samples[far].valid = False
        if self.state.armed_at < 0:
            return
        self._engaged = self._measured = True
        self._held_from = -1
        self._endpoint.heard_ns = self._now_ns()
        where = self._meeting.begun()
        self.sessions[-1] |= {"engaged_s": self._seconds(), "began_at": where}
        if self._side == 1:
            self.sessions[-1]["offsets"] = self._meeting.met()

    def _watch(self, slot: int, skipped: int, came: bool) -> None:
        """Hold where nothing comes; go on, or begin anew, where it comes again."""
        stood = skipped * self.run.period_ns
        if self._held_from < 0:
            silent = self._now_ns() - self._endpoint.heard_ns > self._limits.silence_ns
            if stood > self._limits.silence_ns:  # the motors held their last commands so long
                self._hold(slot, f"this program was suspended for {stood * 1e-9:.3g} s")
            elif silent or self._left:
                self._hold(slot, self._left or "nothing received from it")
        elif came and not self._left:
            owed = max(
                abs(self._site.owed(end, k, self.table, self.axes[i], self.params[i]))
                for (end, k, _), i in zip(self._ends, self._own, strict=True)
            )
            if owed > self._limits.backlog:
                self._renew(f"{owed:.3g} of motion were missed, more than greatest_backlog")
            else:
                self._go_on(slot)
        else:
            self._count_down(slot)

    def _hold(self, slot: int, why: str) -> None:
        self._held_from = slot
        for s in self.axes:
            s.stopping = True
        silences = self.sessions[-1].setdefault("silences", [])
        silences.append({"at_s": self._seconds(), "why": why})

    def _renew(self, why: str) -> None:
        """Ask for another session, into which nothing crosses; hold until then."""
        if not self._left:
            self._miss(why)
            self._line.send(renew=why, of=self.sessions[-1]["id"])

    def _speak(self, said: Mapping[str, Any]) -> None:
        self._line.send(send=said)

    def _settle(self, slot: int, end: int) -> None:
        """Let a port that cannot repay what a silence has left end the session, not the run.

        What it claims counts sessions. `end` is that of the run without this guard.
        """
        owes = self.state.kind == GUARD and self.state.code in self._site.debts
        if not owes or (self._engaged and "silences" not in self.sessions[-1]):
            return
        why = str(self.error())
        forget_stop(self.state, end)
        for s in self.axes:
            s.alarm = 0
        if self._engaged:
            if self._held_from < 0:
                self._hold(slot, why)
            self._renew(why)

    def _go_on(self, slot: int) -> None:
        held_s = (slot - self._held_from) * self.run.period_ns * 1e-9
        self.sessions[-1]["silences"][-1]["for_s"] = held_s
        self._held_from = -1
        for s in self.axes:
            s.stopping = False
        self.state.armed_at = slot  # its ramp again

    def _count_down(self, slot: int) -> None:
        """Stop where the other site has been away for too long."""
        there = not self._engaged and not self._left  # in a session, and not ready yet
        since = self._joined_at if there else max(self._held_from, 0)
        limit_ns = self._limits.ready_ns if there else self._limits.lost_ns
        if (slot - since) * self.run.period_ns <= limit_ns:
            return
        why = lost_words(self.peer, since * self.run.period_ns * 1e-9, self._left)
        if there:
            why = unready_words(self.peer, self._meeting.hindrance)
        self._gone = f"{why} within {limit_ns * 1e-9:g} s, stopped at {self._seconds():.3f} s"
        begin_stop(self.run, self.state, self.axes, slot, LINK, 0, 0)

    # -- the other site's words ---------------------------------------------------------------

    def _obey(self, message: Mapping[str, Any]) -> None:
        if "joined" in message:
            self._rejoin(session_of(message["joined"]))
        elif "lost" in message or "refused" in message:
            self._miss(str(message.get("lost", message.get("refused"))))
        elif "note" in message:
            keep_note(self.sessions[-1], message["note"])
        elif isinstance(message.get("peer"), Mapping):
            self._listen(message["peer"])

    def _miss(self, why: str) -> None:
        """Take note that the other site is away, and from when on that is."""
        if not self._left and not self._engaged:
            self._held_from = self._slot
        self._left = self._left or why

    def _rejoin(self, session: Session) -> None:
        if self._engaged and self._held_from < 0:
            self._hold(self._slot, self._left or "it began anew")
        self._left = ""
        self._join(session)

    def _listen(self, said: Mapping[str, Any]) -> None:
        self._meeting.hear(said)
        if "stops" in said:
            self._miss("")
            self._left = f"it stopped: {said['stops']}"
        elif "left" in said:
            self._miss(str(said["left"]))
        elif "ended" in said:
            self.ended = f"{self.peer} ended the session at {self._seconds():g} s of this run"
            self.stop_after(self._slot)

    # -- counts ---------------------------------------------------------------------------------

    def _link_slot(self) -> int:
        return int(self._ends[0][0].slot) - 1 if self._engaged else -1

    def _seconds(self) -> float:
        return round(self._slot * self.run.period_ns * 1e-9, 9)

    def summary(self) -> dict[str, Any]:
        """Return what is known of the link after the run."""
        endpoint = self._endpoint
        return {
            "peer": self.peer,
            "sessions": self.sessions,
            "ended": self.ended or None,
            "lost": self._gone or None,
            "granted_j": dict(zip(self.pair_names, self._meeting.rest.granted, strict=True)),
            "packets": endpoint.got,
            "refused": endpoint.count(),
            "unread": endpoint.unread,
            "clocks": endpoint.clocks(),
        }
