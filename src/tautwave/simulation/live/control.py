"""`loop.engine: compiled`: the controller of a live run as machine code, equal to the bit."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from tautwave.contracts import Row
from tautwave.controller.records import (
    FAULT,
    FINISHED,
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    RunParams,
    RunState,
    Sample,
)
from tautwave.controller.stops import StopPlace
from tautwave.runtime.control import Control, CoupledControl
from tautwave.simulation.kernel.records import parts_of
from tautwave.simulation.kernel.tables import Fields, blank_records, records_of, view_of
from tautwave.simulation.live.steps import ABSENT, BEGUN, END, INPUTS, KIND, SLOTS, TAKEN
from tautwave.types import AxisCommand, JointState

_put = struct.Struct(f"{INPUTS}d").pack_into
SIZE = 8 * INPUTS
_made = tuple.__new__
NONE = math.nan


class CompiledControl(Control):
    """The pairs of a `CoupledControl`, of which it takes constants, names and columns.

    Everything is compiled, or read from the cache, before this returns.

    Raises
    ------
    ConfigError
        Numba is not installed.
    """

    def __init__(self, given: CoupledControl) -> None:
        from tautwave.simulation.kernel.compiled import load_numba

        load_numba()
        from tautwave.simulation.live.entry import END_CONTROL, STEP_CONTROL, entry

        super().__init__(given.run, given.names, given.params, given.law)
        self.columns = given.columns
        self._pairs = given.pairs
        count = len(given.params)
        self._outcome = records_of(RunState, [self.state])
        axes = records_of(AxisState, self.axes)
        self.axes: list[Any] = [Fields(axis) for axis in axes]
        self._constants = records_of(AxisParams, given.params)
        self._inputs = np.zeros(INPUTS * count)
        self._outputs = np.zeros(count + SLOTS)
        self._row = np.zeros(max(len(self.columns), 1))
        self._begun = count + BEGUN
        self._end = count + END
        self._kind = count + KIND
        self._outputs[self._end] = given.run.cycles
        run = records_of(RunParams, [given.run])
        tables = (
            run,
            self._outcome,
            self._constants,
            axes,
            blank_records(Sample, count),
            records_of(PairParams, given.pairs),
            blank_records(PairState, len(given.pairs), link=given.law.link),
            np.array(given.table or [0.0]),
            self._inputs,
            self._outputs,
            self._row,
        )
        self._tables = tables  # whose addresses are in use
        step = entry(STEP_CONTROL, given.law, parts_of(given.params), parts_of(given.pairs))
        self._step = partial(step, *(table.ctypes.data for table in tables))
        ending = (run, self._outcome, axes, self._outputs)
        self._stop = partial(
            entry(END_CONTROL, given.law), *(table.ctypes.data for table in ending)
        )
        self._given = view_of(self._inputs)
        self._results = view_of(self._outputs)
        self._filled = view_of(self._row)
        self._impedance = [p.impedance for p in given.params]
        self._all_impedance = all(self._impedance)
        self._needs_effort = [p.fed or not p.impedance for p in given.params]
        self._wire = given.wire
        self._floats: Any = view_of(tables[7])
        self._fault = self._faulty = -1
        self._last = 0

    @property
    def end(self) -> int:
        """The slot after the last one."""
        return int(self._results[self._end])

    def take(self, which: int, measured: JointState, slot: int) -> bool:
        """Take what an exchange brought of an axis; return whether it is a sample to be used."""
        return not self.on_samples(which, (measured,), slot)

    def on_samples(self, first: int, measured: Sequence[JointState], slot: int) -> Sequence[int]:
        """Take the samples of a bus, whose first axis is `first`; return which are unusable."""
        given, needs = self._given, self._needs_effort
        unusable = []
        which = first
        for position, _, effort, valid, _ in measured:
            _put(given, SIZE * which, position, effort, valid, TAKEN)
            total = position + effort if needs[which] else position
            if not valid or total - total != 0.0:
                unusable.append(which)
            which += 1
        self._last = which
        return unusable

    def on_missing(self, first: int, count: int) -> None:
        """Do without samples of some axes, without counting them as missing."""
        for which in range(first, first + count):
            at = INPUTS * which
            self._given[at + 2] = 0.0
            self._given[at + 3] = ABSENT
            self._last = which + 1

    def step(self, slot: int, skipped: int) -> bool:
        """Close, exchange and think, or engage; return False if the run must not begin."""
        self._step(slot, skipped, self._fault)
        self._fault = -1
        if self._wire is not None:
            self._wire.carry(self._floats)
        return self._results[self._begun] != 0.0

    def fill(self, row: Row, at: int) -> None:
        """Write all columns at index `at`."""
        filled = self._filled
        if isinstance(row, memoryview):
            row[at : at + len(filled)] = filled
            return
        for place, value in enumerate(filled, at):
            row[place] = value

    def commands(self, first: int, count: int) -> list[AxisCommand]:
        """Return the commands of some axes for their driver."""
        after = first + count
        values = self._results[first:after].tolist()
        if self.dead:
            return [super(CompiledControl, self).command(which) for which in range(first, after)]
        if self._all_impedance:
            return [_made(AxisCommand, (value, 0.0, NONE, 0.0)) for value in values]
        return [  # as AxisCommand(...) does, at half the time
            _made(AxisCommand, (value, 0.0, NONE, 0.0) if effort else (0.0, value, NONE, 0.0))
            for value, effort in zip(values, self._impedance[first:after], strict=True)
        ]

    def command(self, which: int) -> AxisCommand:
        """Return the command of an axis."""
        return self.commands(which, 1)[0]

    def stop_after(self, slot: int) -> None:
        """Ramp down from the next slot on, if nothing ends the run before."""
        if self.end == self.run.cycles:
            self._stop(slot, 0)

    def overrun(self, slot: int, skipped: int) -> None:
        """Stop if the loop slept through too many slots."""
        if skipped >= self.run.overrun_limit:
            self._stop(slot, skipped)

    def fault(self, slot: int, which: int, sentence: str) -> bool:
        """Stop in this cycle since a device said so; return whether no reason is known yet."""
        self.mark_dead(which)
        if self._results[self._kind] != FINISHED or self._fault >= 0:
            return False
        self._fault = self._last
        self._faulty = which
        return True

    def retune(self, which: int, p: AxisParams) -> None:
        """Put other constants in place of an axis'."""
        super().retune(which, p)
        self._constants[which] = records_of(AxisParams, [p])[0]

    def error(self) -> Any:
        """Return the controller's reason to end the run early, or None."""
        self._look()
        return None if self.state.kind == FAULT else super().error()

    def place(self) -> StopPlace | None:
        """Return where that reason came up, or None."""
        self._look()
        return super().place()

    def _look(self) -> None:
        """Take over how the run ended."""
        self.state = RunState(*self._outcome[0].item())
        if self.state.kind == FAULT:
            self.state.which = self._faulty

    def pairs_of_axes(self) -> Sequence[PairParams]:
        """Return the pairs."""
        return self._pairs
