"""The controller of a rig that people operate: the coupling while engaged, else axes at rest."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.columns import ACCOUNT, Column, names
from tautwave.contracts import Row
from tautwave.controller.records import (
    BROKEN,
    FINISHED,
    GUARD,
    MISSING,
    OVERRUN,
    AxisParams,
)
from tautwave.controller.run import forget_stop, run_cycle
from tautwave.controller.stops import stop_error
from tautwave.laws.limit import guard_axis
from tautwave.runtime.carrying.side import SideLoad, take_payload
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.operate import states as st
from tautwave.runtime.operate.books import Books
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
from tautwave.runtime.operate.constants import Operation
from tautwave.runtime.operate.engagement import begin_session, drop_commands, end_session
from tautwave.runtime.operate.inbox import People
from tautwave.runtime.operate.journal import Entry, Journal
from tautwave.runtime.operate.led import switched
from tautwave.runtime.operate.rescaling import held_by, take_scale
from tautwave.runtime.operate.rest.aligning import Alignment
from tautwave.runtime.operate.rest.axis import resting, send_resting, sense_resting
from tautwave.runtime.operate.rest.holds import Holds, spent_sentence

OPERATION = (
    Column(
        "operation.state",
        "",
        "0 idle, 1 aligning, 2 engaged, 3 clutched, 4 holding, 5 stopping",
    ),
    Column(
        "operation.command",
        "",
        "command taken in this cycle: 1 engage, 2 clutch, 3 hold, 4 rest, 5 stop, 6 scale, "
        "7 episode, 8 payload, 9 take_over, 10 hand_back",
    ),
    Column("operation.engagement", "", "number of engagements so far"),
    Column("operation.episode", "", "number of the current episode, 0 for none"),
    Column("operation.scale", "", "factor on every pair's position_scale, 1 at first"),
)
"""What an operated rig writes after its pairs."""
ACCOUNTS = {"operate": "both motors while not engaged; negative: supplied by an alignment"}
"""An element of each pair: its devices while no coupling holds them."""
HOST_OR_SAMPLE = (MISSING, BROKEN, OVERRUN)
"""Ends of a run that come with the samples, or with slots that a stalled host missed."""


class OperatedControl(CoupledControl):
    """A coupled controller behind a table of states.

    Parameters
    ----------
    plain : CoupledControl
        The controller that runs while engaged; this one takes its parts over.
    operation : Operation
        Constants.
    people : People
        Commands, dead-men that have to be held while aligning and engaged, and lamps that are on
        while an episode runs.
    """

    loads: Sequence[SideLoad] = ()

    def __init__(self, plain: CoupledControl, operation: Operation, people: People) -> None:
        super().__init__(
            plain.run, plain.names, plain.params, plain.pair_names, plain.pairs, plain.table,
            plain.law, plain.wire,
        )  # fmt: skip
        self.operation = operation
        self.standing = st.Standing()
        self.journal = Journal(people.task)
        self.lamps, self.inbox, self.led = people.lamps, people.inbox, people.led
        self._engages = people.engage_at_start
        self._free = [resting(p) for p in plain.params]
        self.holds = Holds(plain.params, operation.quanta, operation.brakes)
        self._seated = [False] * len(plain.params)
        self.alignment = Alignment(
            self.axes, self.pairs, operation.pulls, operation.quanta, self.run.period_ns
        )
        self._books = Books(self.columns)
        self._plain_columns = len(self.columns)
        self._outside = [0.0] * len(self.pairs)
        self.scale = 1.0
        self.granted = 0.0
        """[J] What all holds so far might supply together."""
        self._suspect = self._coupled = False
        self._now = self._command = 0
        self._latency = max((p.delay for p in plain.params), default=0) + 2
        self.columns += names(OPERATION)
        for name in self.pair_names:
            self.columns += [f"{name}.operate.{part}" for part in ACCOUNT]

    @property
    def engaged(self) -> bool:
        """Whether the coupling holds the axes."""
        return self._coupled

    def retune(self, which: int, p: AxisParams) -> None:
        """Put other constants in place of an axis'."""
        super().retune(which, p)
        self._free[which] = resting(p)

    # -- one cycle --------------------------------------------------------------------------

    def step(self, slot: int, skipped: int) -> bool:
        """Take commands, then run the coupling, or let the axes rest; a policy leads beside it."""
        going = self._control(slot, skipped)
        if self.led is not None:
            engaged = self.standing.state == st.ENGAGED
            self.led.decide(self.axes, self.params, skipped, engaged=engaged)
        return going

    def _control(self, slot: int, skipped: int) -> bool:
        self._now = slot
        self._command = 0
        if self.state.kind in HOST_OR_SAMPLE and self.standing.state != st.STOPPING:
            self._forgive(device=self.state.kind != OVERRUN)
        self._take_orders(slot)
        if self._coupled:
            going = run_cycle(self.run, self.state, self.view, slot, skipped, self.steps)
            if self.wire is not None:
                self.wire.carry(self.table)
            if self.state.kind == GUARD and self.standing.state != st.STOPPING:
                self._forgive(device=False)
            return going
        for which, (s, p, m) in enumerate(zip(self.axes, self._free, self.samples, strict=True)):
            seated = self._seated[which]
            self._seated[which] = sense_resting(s, p, m, self.table, skipped, seated)
        if self.state.kind == FINISHED:
            self._guard(slot)
        self._rest(slot)
        if self.standing.state == st.ALIGNING:
            self._align(slot)
        return True

    def _take_orders(self, slot: int) -> None:
        if self._engages:
            self._engages = False
            self._obey(Order(st.ENGAGE, "", "rig"))
        for order in self.inbox.take(slot):
            self._obey(order)
        if self.inbox.dead_men and st.follow(self.standing, st.RELEASED) is not None:
            for name in self.inbox.loose():
                self._event(st.RELEASED, f"{name}: the dead-man was released")

    def _rest(self, slot: int) -> None:
        """Decide what every axis does next; a hand may lead its master while its slave aligns."""
        state = self.standing.state
        alignment = self.alignment
        share = min(1.0, (self.state.end - slot) / max(1, self.run.release_cycles))
        for k, q in enumerate(self.pairs):
            for which in (q.master, q.slave):
                s, p, valid = self.axes[which], self._free[which], self.samples[which].valid
                free = state == st.IDLE or (state == st.CLUTCHED and which == q.master)
                pull = alignment.pulls.get(k) if which == q.slave else None
                effort = 0.0
                if free or which in self.dead or alignment.let_go:
                    self.holds.release(which)
                elif pull is not None:
                    self.holds.release(which)
                    effort = pull.effort(s) if valid else 0.0
                else:
                    braked = state != st.ALIGNING or which == q.slave
                    effort = self.holds.effort(which, slot, s, p, valid=valid, braked=braked)
                send_resting(s, p, effort, share * p.ceiling, pushes=pull is not None)
        while self.holds.news:
            self._event(st.FAULT, spent_sentence(self.names[self.holds.news.pop()].name))

    # -- commands and events ------------------------------------------------------------------

    def _obey(self, order: Order) -> None:
        """Do what a person asks for, or note why not."""
        word, slot = order.word, self._now
        if word == TOGGLE:
            word = st.CLUTCH if self.standing.state == st.ENGAGED else st.ENGAGE
        if word not in WORDS:
            self._note(word[:40], order.source, unknown(word), refused=True)
            return
        self._command = WORDS.index(word) + 1
        if word == EPISODE and (why := self.journal.misplaced(order.argument, self.standing.state)):
            self._note(word, order.source, why, refused=True)
        elif word == EPISODE:
            self._note(word, order.source, self.journal.mark(self._seconds(), order.argument))
            for lamp in self.lamps:
                lamp.shows(on=self.journal.running > 0)
        elif word == PAYLOAD:
            text, refused = take_payload(self.loads, order.argument)
            self._note(word, order.source, text, refused=refused)
        elif word in (TAKE_OVER, HAND_BACK):
            text = switched(self.led, word)
            self._note(word, order.source, text, refused=bool(text))
        elif word == st.STOP:
            self.stop_after(slot)
            self._note(word, order.source)
        elif word == st.REST and self._suspect and self.standing.state == st.HOLDING:
            self.wants_reset = True
            self._note(word, order.source, "the devices are reset")
        elif (after := st.follow(self.standing, word)) is None:
            self._note(word, order.source, st.refusal(self.standing, word), refused=True)
        elif word == st.SCALE:
            self._rescale(order)
        elif word == st.ENGAGE and (loose := self.inbox.loose()):
            text = f"engage: press the dead-man first: {', '.join(loose)}"
            self._note(word, order.source, text, refused=True)
        else:
            self._enter(after)
            self._note(word, order.source)

    def _rescale(self, order: Order) -> None:
        """Take another scale's constants: while the pairs hold, or else they let go first."""
        scale = self.operation.called(order.argument)
        if scale is None:
            why = self.operation.no_scale(order.argument)
            self._note(order.word, order.source, why, refused=True)
            return
        scaled = self.operation.scales[scale]
        hindered = held_by(self, scaled) if self._coupled else ""
        self._note(order.word, order.source, f"{scale:g}")
        if hindered:
            self._event(st.PARTED, hindered)
        if not self._coupled:
            self._count_anew()
        take_scale(self, scaled, holding=self._coupled)
        self.scale = scale
        self._free = [resting(p) for p in self.params]
        self.alignment.rescale(self.pairs)

    def _event(self, word: str, text: str = "") -> None:
        after = st.follow(self.standing, word)
        if after is not None:
            self._enter(after)
            self._note(word, "controller", text)

    def _enter(self, after: st.Standing) -> None:
        before, self.standing = self.standing.state, after
        if self._coupled and after.state != st.ENGAGED:
            self._disengage()
        if after.state == before:
            return
        self.alignment.clear()
        if after.state == st.ALIGNING:
            engaged = before == st.ENGAGED
            keep = engaged or before == st.CLUTCHED
            self.alignment.begin(self._now, keep_offset=keep, moving=engaged)
        if not self._coupled:
            self._count_anew()

    def _note(self, word: str, source: str, text: str = "", refused: bool = False) -> None:
        entry = Entry(self._seconds(), word, source, self.standing.state, text, refused)
        self.journal.note(entry)

    def _seconds(self) -> float:
        return round(self._now * self.run.period_ns * 1e-9, 9)

    def stop_after(self, slot: int) -> None:
        """Ramp down from the next slot on, in whatever state the rig is."""
        super().stop_after(slot)
        if self.standing.state != st.STOPPING:
            self.standing = st.Standing(st.STOPPING, self.standing.faulted)
            self.alignment.clear()

    # -- engaging -----------------------------------------------------------------------------

    def _align(self, slot: int) -> None:
        """Bring slaves to where their masters want them; then let go, stand, and engage."""
        if not all(m.valid for m in self.samples):
            return
        alignment = self.alignment
        alignment.start(slot)
        if alignment.is_late(slot):
            why = alignment.hindrance(self.pair_names, self.names, self.params)
            self._event(st.BLOCKED, why)
        elif alignment.let_go:
            if self._all_at_rest(slot):
                self._engage(slot)
        elif alignment.arrived(slot):
            alignment.let_go = slot

    def _all_at_rest(self, slot: int) -> bool:
        """Return whether no command of before is still acting or waiting, and no wall pushes."""
        if any(s.total != 0.0 for s in self.axes):
            self.alignment.let_go = slot
        share = self.run.arm_share
        calm = self.alignment.is_calm(self.params, share)
        return calm and slot - self.alignment.let_go >= self._latency

    def _engage(self, slot: int) -> None:
        """Begin a new session of the coupling where the axes stand; nothing stored crosses."""
        self._bank()
        begin_session(self, slot, self.loads, keep_offset=self.alignment.keep_offset)
        if self.wire is not None:
            self.wire.begin()
        self._coupled = True
        self.journal.engagements += 1
        self._event(st.ALIGNED)

    def _disengage(self) -> None:
        """End the session of the coupling: what it stored is booked as dissipated."""
        self._bank()
        self._coupled = False
        end_session(self, self.loads)
        self._clear_energies()

    # -- faults -------------------------------------------------------------------------------

    def _guard(self, slot: int) -> None:
        """Hold everything if an axis at rest passes a limit."""
        if self.standing.faulted or self.standing.state == st.STOPPING:
            return
        for s, p, name in zip(self.axes, self.params, self.names, strict=True):
            limit = p.site.limit
            code = guard_axis(limit, s.position, s.velocity)
            if code and s.valid:
                low, high = limit.position_low, limit.position_high
                guards = {
                    1: f"outside its position range, {low:.4g} to {high:.4g} {name.unit}: move it "
                    "back by hand",
                    2: f"faster than its velocity limit, {limit.velocity:.4g} {name.unit}/s",
                }
                where = f"{s.position:.4g} {name.unit}"
                self._event(
                    st.FAULT, f"{name.name}: at {where}, {guards.get(code, 'position not finite')}"
                )
                return

    def _forgive(self, *, device: bool) -> None:
        """Turn a reason to end the run into a hold that a person may end."""
        error = stop_error(self.run, self.state, self.names, self.params, self.pairs, self.law)
        forget_stop(self.state, self.run.cycles)
        self._suspect = self._suspect or device
        self._event(st.FAULT, str(error))

    def fault(self, slot: int, which: int, sentence: str) -> bool:
        """Hold on the fault of a device (-1: a bus) until a person has the devices reset."""
        if self.standing.state == st.STOPPING:
            return super().fault(slot, which, sentence)
        self._now = slot
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
        self._now = slot
        if refusal:
            self._note(
                st.REST, "controller", f"the devices have not recovered: {refusal}", refused=True
            )
            return
        self._bank()
        self._clear_energies()
        self._suspect = False
        self.clear_dead()
        self._seated = [False] * len(self._seated)
        drop_commands(self)
        self.standing = st.Standing()
        self._note(st.REST, "controller", "the devices are back")

    # -- books --------------------------------------------------------------------------------

    def _bank(self) -> None:
        """Keep the accounts of the session that ends; each begins at 0 again."""
        row = [0.0] * self._plain_columns
        super().fill(row, 0)
        self._books.bank(row)
        if not self._coupled:
            self.granted += self.holds.granted_to_all()
            for k in range(len(self.pairs)):
                self._outside[k] += self._now_outside(k)

    def _count_anew(self) -> None:
        """Reset the energy budgets for a new state."""
        self._bank()
        self._clear_energies()

    def _clear_energies(self) -> None:
        self.holds.renew()
        for s in self.axes:
            s.port_energy = s.gross_flow = s.uncertainty = 0.0

    def _now_outside(self, k: int) -> float:
        """Return what both motors took out of the devices since the last count [J]."""
        if self._coupled:
            return 0.0
        q = self.pairs[k]
        return sum(self.params[i].weight * self.axes[i].port_energy for i in (q.master, q.slave))

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`."""
        super().fill(row, at)
        self._books.add(row, at)
        at += self._plain_columns
        row[at] = st.STATES.index(self.standing.state)
        row[at + 1] = self._command
        row[at + 2] = self.journal.engagements
        row[at + 3] = self.journal.running
        row[at + 4] = self.scale
        at += len(OPERATION)
        for k in range(len(self.pairs)):
            taken = self._outside[k] + self._now_outside(k)
            row[at], row[at + 1], row[at + 2] = taken, 0.0, taken
            at += 3
