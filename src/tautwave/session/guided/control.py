"""The controller of a guided procedure: axes without coupling, and a guide that counts slots.

A guide is a generator: each `yield` lets one slot pass. It sees the axes through this controller,
asks the person through it, and may push an axis within the limits of the rig.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from typing import Any

from tautwave.contracts import Row
from tautwave.controller.axis import is_due, miss_sample, pass_slot
from tautwave.controller.records import FINISHED, NEVER, AxisParams, RunParams
from tautwave.controller.rows import axis_columns, fill_axis
from tautwave.controller.run import stop_on_guard
from tautwave.controller.steps import ALONE
from tautwave.controller.stops import AxisName
from tautwave.laws.limit import guard_axis
from tautwave.runtime.control import Control
from tautwave.runtime.operate.rest.axis import send_resting, sense_resting
from tautwave.session.guided.answers import Answers, Declined, Misread, confirmed

SHOW_NS = 200_000_000

Guide = Callable[["GuidedControl"], Generator[None, None, Any]]
"""Takes the controller, and returns its result when the procedure is over."""


def _nothing(name: str) -> tuple[float, float]:
    """Witness of devices that report neither velocity nor effort."""
    return math.nan, math.nan


def _unwatched() -> dict[str, float | None]:
    """Time-outs of devices that have none."""
    return {}


def _at_once(seconds: float) -> None:
    """Silence of a controller without a loop."""


class GuidedControl(Control):
    """No coupling: a guide decides what each axis does.

    Parameters
    ----------
    run, names, params
        See `Control`.
    table : list of float
        Commands on their way.
    guide : Guide
        The procedure.
    answers : Answers
        Of the person.
    say, show : callable
        Take a sentence, and a line of numbers that the next one replaces.
    guarded : bool
        Stop at the limits of the rig.
    """

    def __init__(
        self,
        run: RunParams,
        names: Sequence[AxisName],
        params: Sequence[AxisParams],
        table: list[float],
        guide: Guide,
        answers: Answers,
        say: Callable[[str], None],
        show: Callable[[str], None],
        *,
        guarded: bool,
    ) -> None:
        super().__init__(run, names, params)
        self._table = table
        self._answers, self.say, self._show = answers, say, show
        self._guarded = guarded
        self._seated = [False] * len(params)
        self._push = [0.0] * len(params)
        self._drive = [0.0] * len(params)
        self._shown_ns = -SHOW_NS
        self._slot = 0
        self._places = {name.name: at for at, name in enumerate(names)}
        self.witness: Callable[[str], tuple[float, float]] = _nothing
        """Velocity and motor effort that a device reports of an axis, along the axis [SI]."""
        self.watchdogs: Callable[[], Mapping[str, float | None]] = _unwatched
        """After what silence [s] each device stops by itself; None or absent: never."""
        self.silence: Callable[[float], None] = _at_once
        """Has the loop's thread send nothing for some time [s]."""
        self.faults: dict[str, str] = {}
        """What devices reported first after a silence, by axis."""
        self._was_silent = False
        self._steps = guide(self)
        self.number = 0
        self.over = False
        self.result: Any = None
        for name, p in zip(names, params, strict=True):
            self.columns += axis_columns(name.name, p, ALONE)
        self.columns.append("guide.step")

    # -- for the guide ------------------------------------------------------------------------

    @property
    def now_ns(self) -> int:
        """Time since the start [ns]."""
        return self._slot * self.run.period_ns

    def position(self, name: str) -> float:
        """Return an axis' position [rad or m]."""
        return self.axes[self._places[name]].position

    def velocity(self, name: str) -> float:
        """Return an axis' velocity [rad/s or m/s]."""
        return self.axes[self._places[name]].velocity

    def outside(self, name: str) -> float:
        """Return what an axis' effort sensor shows, less its offset [N m or N]."""
        return self.axes[self._places[name]].outside

    def push(self, name: str, effort: float) -> None:
        """Push an axis along its position [N m or N], until the next call."""
        self._push[self._places[name]] = effort

    def drive(self, name: str, velocity: float) -> None:
        """Command a velocity [rad/s or m/s] to an axis that takes one, until the next call."""
        self._drive[self._places[name]] = velocity

    def fall_silent(self, seconds: float) -> None:
        """Send nothing for some time [s]; after that faults and missing samples end nothing."""
        self._was_silent = True
        self.run = self.run._replace(missing_limit=NEVER, overrun_limit=NEVER)
        self.silence(seconds)

    def fault(self, slot: int, which: int, sentence: str) -> bool:
        """Stop on the fault of a device; after a silence it is what was waited for."""
        if not self._was_silent:
            return super().fault(slot, which, sentence)
        self.mark_dead(which)
        if which >= 0:
            self.faults.setdefault(self.names[which].name, sentence)
        return False

    def ask(
        self, question: str, read: Callable[[str], Any] = confirmed
    ) -> Generator[None, None, Any]:
        """Ask until there is an answer that can be read, and pass slots meanwhile.

        Raises
        ------
        Declined
            The person said no.
        """
        self.number += 1
        said = question
        while True:
            self.say(said)
            self._answers.ask(self.now_ns)
            while (answer := self._answers.take(self.now_ns)) is None:
                yield
            try:
                return read(answer)
            except Misread as err:
                said = f"{answer!r}: {err}. {question}"
            except Declined as err:
                raise Declined(f"{err} to: {question}") from None

    def show(self, text: Callable[[], str]) -> None:
        """Show numbers, now and then."""
        if self.now_ns - self._shown_ns >= SHOW_NS:
            self._shown_ns = self.now_ns
            self._show(text())

    # -- for the loop -------------------------------------------------------------------------

    def step(self, slot: int, skipped: int) -> bool:
        """Let the guide go on by one slot."""
        self._slot = slot
        due = [self._sense(which, slot, skipped) for which in range(len(self.axes))]
        for which, (s, p) in enumerate(zip(self.axes, self.params, strict=True)):
            s.guard = guard_axis(p.site.limit, s.position, s.velocity) if self._guarded else 0
            stop_on_guard(self.run, self.state, self.axes, slot, which)
        going = self.state.kind == FINISHED and self.state.end == self.run.cycles
        if all(self._seated) and going:
            try:
                next(self._steps)
            except StopIteration as ended:
                self.result = ended.value
                self.over = True
                self.stop_after(slot)
        for which, (s, p) in enumerate(zip(self.axes, self.params, strict=True)):
            if not due[which]:
                continue
            effort = -self._push[which] if going and s.valid else 0.0
            send_resting(s, p, effort, p.ceiling, pushes=True)
            if going and s.valid and not (p.impedance or s.dead):
                s.command = self._drive[which]
        return True

    def _sense(self, which: int, slot: int, skipped: int) -> bool:
        """Take an axis' sample if its bus was served in this slot; return whether it was."""
        s, p, m = self.axes[which], self.params[which], self.samples[which]
        passed = sum(is_due(p, at) for at in range(slot - skipped, slot))
        here = is_due(p, slot)
        if here:
            seated = self._seated[which]
            self._seated[which] = sense_resting(s, p, m, self._table, passed, seated)
        elif passed and self._seated[which]:
            for _ in range(passed):
                pass_slot(s, p, self._table, ALONE.steps)
            miss_sample(s, p, ALONE.steps)
        return here

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`; there are no books without a coupling."""
        for s, p in zip(self.axes, self.params, strict=True):
            at = fill_axis(row, at, s, p, 1.0, ALONE.steps)
        row[at] = self.number
