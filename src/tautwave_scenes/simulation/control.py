"""The controller of a scene in a live run, compiled with the scene's steps: equal to the bit.

Engaging, and what happens once in a run (a sample that is missing or broken, a request to stop), is
left to `runtime.axes`: the state goes there and back.
"""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from typing import Any

import numpy as np

from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState, RunParams, RunState, Sample
from tautwave.simulation.kernel.records import parts_of
from tautwave.simulation.kernel.tables import blank_records, records_of, view_of
from tautwave.types import AxisCommand, JointState
from tautwave_scenes.networks.ledger import Ledger
from tautwave_scenes.runtime.axes import SCENE, SceneControl
from tautwave_scenes.runtime.hold import Debt, Held
from tautwave_scenes.simulation.cycle import INPUTS, ScenePort, SceneState
from tautwave_scenes.simulation.ticking import CompiledScene


class CompiledSceneControl(SceneControl):
    """A `SceneControl` whose scene is a `CompiledScene` without strings, of which it takes all.

    Compiled, or read from the cache, before this returns.

    Raises
    ------
    ConfigError
        Numba is not installed.
    """

    def __init__(self, given: SceneControl) -> None:
        from tautwave.simulation.live.entry import entry
        from tautwave_scenes.simulation.entry import STEP_SCENE

        self.__dict__.update(given.__dict__)
        self._begun = False
        self._entry = entry(STEP_SCENE, SCENE, parts_of(self.params))
        self._impedance = [p.impedance for p in self.params]
        self._inputs = view_of(np.zeros(INPUTS * len(self.params)))

    def _begin(self) -> None:
        """Hand the state over to compiled code."""
        scene = self.scene
        model = scene.model
        assert isinstance(model, CompiledScene)
        floats, whole, places, scheme, period = model.given
        count, account = len(self.ports), scene.account
        state = SceneState(
            scheme, period, len(self._nodes), scene.forced, scene.pushed, account is not None,
            scene.slot, scene.ended,
        )  # fmt: skip
        ends = [
            ScenePort(scale, offset, most, place, effort)
            for scale, offset, most, place, effort in zip(
                scene.scales, scene.offsets, scene.most, scene.positions, scene.efforts, strict=True
            )
        ]
        self._outputs = np.zeros(len(self.params) + 1)
        self._row = np.zeros(len(self.columns))
        self._tables: tuple[Any, ...] = (
            records_of(RunParams, [self.run]),
            records_of(RunState, [self.state]),
            records_of(AxisParams, self.params),
            records_of(AxisState, self.axes),
            blank_records(Sample, len(self.params)),
            records_of(SceneState, [state]),
            records_of(ScenePort, ends),
            blank_records(Held, count) if account is None else records_of(Held, account.helds),
            records_of(Debt, [Debt() if account is None else account.state]),
            np.array([*self._table, 0.0]),
            np.array([0.0] if account is None else [*account.pipe, 0.0]),
            floats,
            whole,
            places,
            np.array(self.ports, np.int64),
            np.array(scene.forces),
            np.zeros(count),
            np.array(model.start),
            np.asarray(self._inputs),
            self._outputs,
            self._row,
        )
        self._outcome, self._states = self._tables[1], self._tables[3]
        self._step = partial(
            self._entry,
            *(table.ctypes.data for table in self._tables),
            *(count, len(floats), len(whole), len(places)),
        )
        self._ledger = model.figures
        self._results, self._filled = view_of(self._outputs), view_of(self._row)
        self._results[len(self.params)] = self.state.end
        self._begun = True

    def _pull(self) -> None:
        """Take the state of axes and run back into the objects of plain Python."""
        if not self._begun:
            return
        _copy(self._outcome[0], self.state)
        for record, axis in zip(self._states, self.axes, strict=True):
            _copy(record, axis)
        self.scene.model.booked = Ledger(*self._ledger)

    def _push(self) -> None:
        if self._begun:
            self._outcome[:] = records_of(RunState, [self.state])
            self._states[:] = records_of(AxisState, self.axes)
            self._results[len(self.params)] = self.state.end

    @property
    def end(self) -> int:
        """The slot after the last one."""
        return int(self._results[len(self.params)]) if self._begun else self.state.end

    def take(self, which: int, measured: JointState, slot: int) -> bool:
        """Take an axis' sample from an exchange; return whether it is usable."""
        position, _, effort, valid, _ = measured
        total = position if self._impedance[which] else position + effort
        fine = valid and total - total == 0.0
        at = INPUTS * which
        inputs = self._inputs
        inputs[at] = position
        inputs[at + 1] = effort
        inputs[at + 2] = fine
        if fine and self._begun:
            return True
        self._pull()
        usable = super().take(which, measured, slot)
        self._push()
        return usable

    def on_missing(self, first: int, count: int) -> None:
        """Skip the samples of some axes without counting them as missing."""
        super().on_missing(first, count)
        for which in range(first, first + count):
            self._inputs[INPUTS * which + 2] = 0.0

    def step(self, slot: int, skipped: int) -> bool:
        """Close every axis and step the scene, or engage."""
        if self._begun:
            self._step(slot, skipped)
            return True
        begun = super().step(slot, skipped)
        if self.state.armed_at >= 0:
            self._begin()
            super().fill(self._filled, 0)
            for which, axis in enumerate(self.axes):
                self._results[which] = axis.command
        return begun

    def fill(self, row: Row, at: int) -> None:
        """Write all columns of the scene at index `at`."""
        if not self._begun:
            super().fill(row, at)
            return
        filled = self._filled
        if isinstance(row, memoryview):
            row[at : at + len(filled)] = filled
            return
        for place, value in enumerate(filled, at):
            row[place] = value

    def command(self, which: int) -> AxisCommand:
        """Return the command of an axis for its driver."""
        if not self._begun or which in self.dead:
            return super().command(which)
        value = self._results[which]
        return AxisCommand(value, 0.0) if self._impedance[which] else AxisCommand(0.0, value)

    def stop_after(self, slot: int) -> None:
        """Ramp down from the next slot on, unless the run ends first."""
        if self.end == self.run.cycles:
            self._pull()
            super().stop_after(slot)
            self._push()

    def overrun(self, slot: int, skipped: int) -> None:
        """Stop if the loop slept through too many slots."""
        if skipped >= self.run.overrun_limit:
            self._pull()
            super().overrun(slot, skipped)
            self._push()

    def fault(self, slot: int, which: int, sentence: str) -> bool:
        """Stop on the fault of a device; return whether that is the first reason."""
        self._pull()
        first = super().fault(slot, which, sentence)
        self._push()
        return first

    def axis(self, which: int) -> AxisState:
        """Return the state of an axis as it is between two steps."""
        self._pull()
        return super().axis(which)

    def retune(self, which: int, p: AxisParams) -> None:
        """Put other constants in place of an axis'."""
        super().retune(which, p)
        if self._begun:
            self._tables[2][which] = records_of(AxisParams, [p])[0]

    def error(self) -> Any:
        """Return the controller's reason to end the run early, or None."""
        self._pull()
        return super().error()

    def place(self) -> Any:
        """Return where that reason came up, or None."""
        self._pull()
        return super().place()


def _copy(record: Any, into: Any) -> None:
    for field in fields(into):
        if field.name in record.dtype.names:
            value = record[field.name]
            if value.dtype.names is None:
                setattr(into, field.name, value.item())
            else:
                _copy(value, getattr(into, field.name))
