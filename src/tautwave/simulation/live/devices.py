"""Simulated devices of a loopback bus as machine code; what they do is that of the kernel."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from tautwave.contracts import BusSpec, Row
from tautwave.controller.records import Sample
from tautwave.simulation.kernel.pack import Pieces, pack_device
from tautwave.simulation.kernel.records import DeviceParams, DeviceState
from tautwave.simulation.kernel.tables import blank_records, records_of, view_of
from tautwave.truth import AxisModel, truth_columns
from tautwave.types import JointState

_made = tuple.__new__


class CompiledDevices:
    """The devices behind one loopback bus: a simulator for `build_rig`, on the grid of its loop.

    Parameters
    ----------
    bus : BusSpec
        The bus and its axes.
    models : sequence of AxisModel
        What is true of them.
    cycles : int
        Cycles of the run, for which noise and missing samples are drawn.

    Attributes
    ----------
    columns : list of str
        What `fill` writes: the truth about every axis, in their order.
    """

    def __init__(self, bus: BusSpec, models: Sequence[AxisModel], cycles: int) -> None:
        from tautwave.simulation.live.entry import STEP_DEVICES, entry

        if bus.divisor > 1:
            models = [it._replace(command_delay=max(it.command_delay, 1.0)) for it in models]
        floats, flags = Pieces(np.float64), Pieces(np.bool_)
        params = [pack_device(model, floats, flags, cycles + 1) for model in models]
        count = len(models)
        bodies = blank_records(DeviceState, count)
        bodies["x"] = [model.start_position for model in models]
        values = np.zeros(max(3 * count, 1))
        self.values = view_of(values)[: 3 * count]
        self.axes = bus.axes
        self.columns = [
            name
            for spec, of in zip(bus.axes, params, strict=True)
            for name in truth_columns(spec.name, hand=of.last >= 0)
        ]
        row = np.zeros(max(len(self.columns), 1))
        self.row = view_of(row)[: len(self.columns)]
        tables: tuple[Any, ...] = (
            records_of(DeviceParams, params),
            bodies,
            blank_records(Sample, count),
            floats.join(),
            flags.join(),
            values,
            row,
        )
        self._tables = tables  # whose addresses are in use
        self._step = partial(entry(STEP_DEVICES), *(table.ctypes.data for table in tables), count)
        self._commands = self.values[:count]
        self._period_ns = round(models[0].period * 1e9) if models else 0
        self._origin_ns: int | None = None
        self._slot = 0
        self._commanded = False
        self.transport = self

    def rest(self) -> None:
        """Hold still: the next `advance` begins a new grid at its own time."""
        self._origin_ns = None

    def measure(self) -> list[JointState]:
        """Return what the drives report at this slot."""
        each = iter(self.values.tolist())
        return [  # as JointState(...) does, at half the time
            _made(JointState, (position, math.nan, effort, valid != 0.0, 0))
            for position, effort, valid in zip(each, each, each, strict=True)
        ]

    def command(self, values: Sequence[float]) -> None:
        """Take an effort or a velocity of each device for the slots to come."""
        self._commands[:] = array("d", values)
        self._commanded = True

    def advance(self, to_ns: int) -> None:
        """Move all devices over the slots that have passed at `to_ns`, and measure them."""
        if self._origin_ns is None:
            self._origin_ns = to_ns
            self._slot = 0
        else:
            slot = (to_ns - self._origin_ns + self._period_ns // 2) // self._period_ns
            self._slot = max(slot, self._slot)
        self._step(self._slot, self._commanded)
        self._commanded = False

    def fill(self, row: Row, at: int) -> None:
        """Write the truth at this slot into `row` from index `at` on."""
        if isinstance(row, memoryview):
            row[at : at + len(self.row)] = self.row
            return
        for place, value in enumerate(self.row, at):
            row[place] = value

    def close(self) -> None:
        """Nothing to release."""
