"""The controller in the loop: measurements in, commands and a row out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tautwave.contracts import Row
from tautwave.controller.records import (
    FAULT,
    OVERRUN,
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    RunParams,
    RunState,
    RunView,
    Sample,
)
from tautwave.controller.rows import element_names, fill_pair, pair_columns
from tautwave.controller.run import begin_run, begin_stop, check_sample, end_by, run_cycle
from tautwave.controller.slotted import all_slotted, slotted, with_views
from tautwave.controller.steps import ALONE, Law
from tautwave.controller.stops import AxisName, StopPlace, stop_error, stop_place
from tautwave.errors import DeviceFault, TautwaveError
from tautwave.types import SAFE_COMMAND, AxisCommand, JointState

if TYPE_CHECKING:
    from tautwave.runtime.wire import Wire


class Control(ABC):
    """The controller of one run; its axes are in the order of the buses.

    Parameters
    ----------
    run : RunParams
        Length, ramps and limits.
    names : sequence of AxisName
        Names of the axes.
    params : sequence of AxisParams
        Constants of the axes.
    law : Law
        The coupling that holds them.

    Attributes
    ----------
    axes : list of AxisState
        The axes.
    state : RunState
        State of the run.
    columns : list of str
        What `fill` writes.
    trim_ns : int
        By how much the next slot is longer [ns], where the grid follows another clock.
    wants_reset : bool
        The loop is to open and enable all devices anew, then to call `devices_are`.
    """

    def __init__(
        self,
        run: RunParams,
        names: Sequence[AxisName],
        params: Sequence[AxisParams],
        law: Law = ALONE,
    ) -> None:
        self.run = run
        self.law = law
        self.names = names
        self.params = params
        self.state = RunState()
        self.axes = [AxisState(end=law.end()) for _ in params]
        self.samples = [Sample() for _ in params]
        self.columns: list[str] = []
        self.trim_ns = 0
        self.wants_reset = False
        self.dead: set[int] = set()
        """Axes whose device is in fault: they get their safe command, whatever they weigh."""
        self._complaint = ""
        begin_run(run, self.state, params, self.axes)

    @property
    def params(self) -> Sequence[AxisParams]:
        """Constants of the axes; `quick` has them with slots, for what runs in each cycle."""
        return self._params

    @params.setter
    def params(self, given: Sequence[AxisParams]) -> None:
        self._params = tuple(given)
        self.quick = all_slotted(given)
        self._view: RunView | None = None

    @property
    def law(self) -> Law:
        """The coupling that holds the axes; `steps` has its steps with slots."""
        return self._law

    @law.setter
    def law(self, given: Law) -> None:
        self._law = given
        self.steps = slotted(given.steps)

    @property
    def end(self) -> int:
        """The slot after the last one."""
        return self.state.end

    @property
    def stopped(self) -> bool:
        """Whether there is a reason to stop."""
        return self.state.kind != 0

    def take(self, which: int, measured: JointState, slot: int) -> bool:
        """Take an axis' sample from an exchange; return whether it is usable."""
        m = self.samples[which]
        m.position, _, m.effort, m.valid, _ = measured
        check_sample(self.run, self.state, self.quick[which], self.axes, m, slot, which)
        return m.valid

    def on_samples(self, first: int, measured: Sequence[JointState], slot: int) -> Sequence[int]:
        """Take the samples of a bus, whose first axis is `first`; return which are unusable."""
        return [
            which for which, one in enumerate(measured, first) if not self.take(which, one, slot)
        ]

    def on_missing(self, first: int, count: int) -> None:
        """Skip the samples of some axes without counting them as missing."""
        for m in self.samples[first : first + count]:
            m.valid = False

    @abstractmethod
    def step(self, slot: int, skipped: int) -> bool:
        """Close, exchange and decide, or engage; return False if the run must not begin."""

    @abstractmethod
    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`."""

    def commands(self, first: int, count: int) -> list[AxisCommand]:
        """Return the commands of some axes for their driver."""
        return [self.command(which) for which in range(first, first + count)]

    def command(self, which: int) -> AxisCommand:
        """Return the command of an axis for its driver."""
        if which in self.dead:
            return SAFE_COMMAND
        value = self.axes[which].command
        return AxisCommand(value, 0.0) if self.quick[which].impedance else AxisCommand(0.0, value)

    def stop_after(self, slot: int) -> None:
        """Ramp down from the next slot on, unless the run ends first."""
        if self.state.end == self.run.cycles:
            end_by(self.run, self.state, slot)

    def overrun(self, slot: int, skipped: int) -> None:
        """Stop if the loop skipped too many slots."""
        if skipped >= self.run.overrun_limit:
            begin_stop(self.run, self.state, self.axes, slot, OVERRUN, 0, skipped)

    def fault(self, slot: int, which: int, sentence: str) -> bool:
        """Stop on the fault of a device (-1: a bus); return whether that is the first reason."""
        self.mark_dead(which)
        first = begin_stop(self.run, self.state, self.axes, slot, FAULT, which, 0)
        self._complaint = sentence if first else self._complaint
        return first

    def mark_dead(self, which: int) -> None:
        """Send an axis no more effort: its device is in fault (-1: only its bus is known)."""
        if which >= 0:
            self.dead.add(which)
            self.axes[which].dead = True

    def clear_dead(self) -> None:
        """Clear the faults of all devices: they were reset."""
        self.dead.clear()
        for s in self.axes:
            s.dead = False

    def devices_are(self, slot: int, refusal: str) -> None:
        """Take note of devices that were reset: all are enabled again, or why not."""
        self.wants_reset = False

    @property
    def engaged(self) -> bool:
        """Whether the coupling holds the axes."""
        return True

    def axis(self, which: int) -> AxisState:
        """Return the state of an axis as it is between two steps."""
        return self.axes[which]

    def retune(self, which: int, p: AxisParams) -> None:
        """Put other constants in place of an axis'."""
        self.params = [*self.params[:which], p, *self.params[which + 1 :]]

    def error(self) -> TautwaveError | None:
        """Return the controller's reason to end the run early, or None."""
        if self.state.kind == FAULT:
            return DeviceFault(self._complaint)
        return stop_error(
            self.run, self.state, self.names, self.params, self.pairs_of_axes(), self.law
        )

    def place(self) -> StopPlace | None:
        """Return where that reason came up, or None."""
        return stop_place(self.run, self.state, self.names, self.pairs_of_axes(), self.law)

    def pairs_of_axes(self) -> Sequence[PairParams]:
        """Return the names of pairs for a refusal to engage."""
        return ()


class CoupledControl(Control):
    """Pairs of axes and the coupling between them.

    Parameters
    ----------
    run, names, params, law
        See `Control`.
    pair_names : sequence of str
        Names of the pairs.
    pairs : sequence of PairParams
        Constants of the pairs.
    table : list of float
        What the table of commands and lines begins with.
    wire : Wire, optional
        Carries packets between both sides.
    """

    def __init__(
        self,
        run: RunParams,
        names: Sequence[AxisName],
        params: Sequence[AxisParams],
        pair_names: Sequence[str],
        pairs: Sequence[PairParams],
        table: list[float],
        law: Law,
        wire: Wire | None = None,
    ) -> None:
        super().__init__(run, names, params, law)
        self.wire = wire
        self.pair_names = pair_names
        self.pairs = pairs
        self.states = [PairState(link=law.link()) for _ in pairs]
        self.table = table
        for name, q in zip(pair_names, pairs, strict=True):
            self.columns += pair_columns(name, q, params[q.master], params[q.slave], law)

    @property
    def pairs(self) -> Sequence[PairParams]:
        """Constants of the pairs; `quick_pairs` has them with slots."""
        return self._pairs

    @pairs.setter
    def pairs(self, given: Sequence[PairParams]) -> None:
        self._pairs = tuple(given)
        self.quick_pairs = all_slotted(given)
        self._view = None

    @property
    def view(self) -> RunView:
        """Axes and pairs as the steps see them, made again where constants were replaced."""
        if self._view is None:
            axes, samples = self.axes, self.samples
            pairs, states = self.quick_pairs, self.states
            made = RunView(self.quick, axes, samples, pairs, states, self.table)
            self._view = slotted(with_views(made))
        return self._view

    def step(self, slot: int, skipped: int) -> bool:
        """Close, exchange and decide, or engage; return False if the run must not begin."""
        begun = run_cycle(self.run, self.state, self.view, slot, skipped, self.steps)
        if self.wire is not None:
            self.wire.carry(self.table)
        return begun

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`."""
        steps = self.steps
        for pair in self.view.views:
            at = fill_pair(row, at, pair, steps)

    def pairs_of_axes(self) -> Sequence[PairParams]:
        """Return the pairs."""
        return self.pairs

    def elements(self, pair: str) -> list[str]:
        """Return the names of a pair's elements."""
        q = self.pairs[self.pair_names.index(pair)]
        return element_names(q, self.params[q.master], self.params[q.slave], self.law)
