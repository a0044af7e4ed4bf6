"""One cycle of the controller, and one slot of simulated devices, as calls from the live loop.

What crosses is in arrays: `inputs`, `INPUTS` floats an axis (position, effort, whether valid, and
whether anything was read at all); `outputs`, a command an axis and then what `SLOTS` names; a row.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from typing import NamedTuple

from tautwave.controller.pair import pair_at
from tautwave.controller.records import (
    FAULT,
    OVERRUN,
    AxisState,
    RunParams,
    RunState,
    RunView,
    Sample,
)
from tautwave.controller.rows import fill_pair
from tautwave.controller.run import begin_stop, check_sample, end_by, run_cycle
from tautwave.controller.steps import Steps
from tautwave.simulation.kernel.device import (
    aim_hand,
    begin_sensor,
    command_device,
    pass_device,
)
from tautwave.simulation.kernel.records import DeviceParams, DeviceState
from tautwave.simulation.kernel.rows import fill_device
from tautwave.simulation.kernel.run import sense_device

INPUTS = 4
NOTHING, ABSENT, TAKEN = 0.0, 1.0, 2.0
"""Last of an axis' inputs: not its slot; no request in time, which is not a miss; read."""

BEGUN, END, KIND, SLOTS = 0, 1, 2, 3
"""Outputs after the commands: whether the run may go on, the slot after the last, why it stops."""


class Ways(NamedTuple):
    """Arrays on the way in and out of a cycle of the controller."""

    inputs: MutableSequence[float]
    outputs: MutableSequence[float]
    row: MutableSequence[float]


class Devices(NamedTuple):
    """Simulated devices, what they measured, and their tables of numbers and of lost samples."""

    devices: Sequence[DeviceParams]
    bodies: Sequence[DeviceState]
    samples: Sequence[Sample]
    table: MutableSequence[float]
    flags: Sequence[bool]


def step_control(
    r: RunParams,
    o: RunState,
    x: RunView,
    ways: Ways,
    slot: int,
    skipped: int,
    fault: int,
    steps: Steps,
) -> None:
    """Run one cycle on what was read.

    `fault` is the first axis after the bus whose device stops the run, -1 for none: what comes
    first in the order of the buses is the reason that is kept.
    """
    inputs = ways.inputs
    outputs = ways.outputs
    for i in range(r.axes):
        if i == fault:
            begin_stop(r, o, x.axes, slot, FAULT, 0, 0)
        at = INPUTS * i
        if inputs[at + 3] == NOTHING:
            continue
        m = x.samples[i]
        m.position = inputs[at]
        m.effort = inputs[at + 1]
        m.valid = inputs[at + 2] != 0.0
        if inputs[at + 3] == TAKEN:
            check_sample(r, o, x.params[i], x.axes, m, slot, i)
        inputs[at + 3] = NOTHING
    if fault == r.axes:
        begin_stop(r, o, x.axes, slot, FAULT, 0, 0)
    begun = run_cycle(r, o, x, slot, skipped, steps)
    if begun:
        at = 0
        for k in range(r.pairs):
            at = fill_pair(ways.row, at, pair_at(x, k), steps)
    for i in range(r.axes):
        outputs[i] = x.axes[i].command
    outputs[r.axes + BEGUN] = 0.0
    if begun:
        outputs[r.axes + BEGUN] = 1.0
    outputs[r.axes + END] = float(o.end)
    outputs[r.axes + KIND] = float(o.kind)


def end_control(
    r: RunParams,
    o: RunState,
    axes: Sequence[AxisState],
    outputs: MutableSequence[float],
    slot: int,
    skipped: int,
) -> None:
    """Stop for `skipped` slots, or ramp down on request if it is 0."""
    if skipped > 0:
        begin_stop(r, o, axes, slot, OVERRUN, 0, skipped)
    else:
        end_by(r, o, slot)
    outputs[r.axes + END] = float(o.end)
    outputs[r.axes + KIND] = float(o.kind)


def step_devices(
    w: Devices,
    values: MutableSequence[float],
    row: MutableSequence[float],
    count: int,
    slot: int,
    command: bool,
) -> None:
    """Hand devices their commands, if there are new ones, move them on to `slot`, measure there.

    `values` begins with the commands, then is position, effort and validity of each device.
    """
    if command:
        for i in range(count):
            command_device(w.bodies[i], w.devices[i], values[i])
    at = 0
    for i in range(count):
        b = w.bodies[i]
        d = w.devices[i]
        m = w.samples[i]
        if b.slot == 0:
            aim_hand(b, d, w.table)
            if b.reads == 0:
                begin_sensor(b, d, w.table)
        while b.slot < slot:
            pass_device(b, d, w.table)
        sense_device(m, b, d, w.table, w.flags)
        values[3 * i] = m.position
        values[3 * i + 1] = m.effort
        values[3 * i + 2] = 0.0
        if m.valid:
            values[3 * i + 2] = 1.0
        at = fill_device(row, at, b, d)
