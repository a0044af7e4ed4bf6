"""A whole run on the fake clock: simulated devices around the controller, nothing that can be late.

Written in the subset that plain Python and numba share. The order of every operation is that of the
live path, so the rows are equal to the bit.
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from typing import Any

from tautwave.controller.axis import is_due
from tautwave.controller.pair import pair_at
from tautwave.controller.records import OVERRUN, RunView, Sample
from tautwave.controller.rows import fill_pair
from tautwave.controller.run import begin_run, begin_stop, check_sample, run_cycle
from tautwave.controller.steps import Steps
from tautwave.simulation.kernel.device import (
    aim_hand,
    begin_sensor,
    command_device,
    measure_device,
    pass_device,
)
from tautwave.simulation.kernel.records import DeviceParams, DeviceState, Tables
from tautwave.simulation.kernel.rows import fill_device, fill_measured


def ask_device(
    m: Sample, b: DeviceState, d: DeviceParams, n: int, slot: int, table: MutableSequence[float]
) -> bool:
    """Serve a device on a bus of divisor `n`; return whether a sample is to be read now."""
    exchange = slot // n
    phase = slot % n
    if b.asked >= 0 and b.asked < exchange:
        b.reads += 1  # drained and discarded
        b.asked = -1
        m.valid = False
    if b.asked < 0 and (phase == 0 or 2 * (phase + 1) <= n):
        while b.slot < exchange:
            pass_device(b, d, table)
        b.asked = exchange
    if phase < n - 1:
        return False
    if b.asked < 0:
        m.valid = False
        return False
    b.asked = -1
    return True


def sense_device(
    m: Sample, b: DeviceState, d: DeviceParams, table: Sequence[float], flags: Sequence[bool]
) -> None:
    """Read a device at its slot: its next noise, and whether its next sample is lost."""
    noise = 0.0
    if d.position_noise > 0.0:
        noise = table[d.noise + b.reads]
    loud = 0.0
    if d.senses and d.sensor.noise > 0.0:
        loud = table[d.sensor_noise + b.reads]
    measure_device(m, b, d, noise, d.loses and flags[d.missing + b.reads], loud)
    b.reads += 1


def run_rig(t: Tables, steps: Steps) -> int:
    """Run until `out` is full or the run is at its end; return how many rows were written.

    Called again before its end, it goes on with the next row, at the beginning of `out`.
    """
    r = t.runs[0]
    f = t.fakes[0]
    o = t.outcomes[0]
    table = t.table
    out = t.out
    x = RunView(t.params, t.axes, t.samples, t.pairs, t.states, table, t.views)
    slot = o.next_slot
    began: int = o.done
    cycle = began
    skipped = o.skipped
    o.done = 0
    o.next_slot = 0
    o.skipped = 0
    if cycle == 0:
        begin_run(r, o, x.params, x.axes)
        for i in range(r.axes):
            aim_hand(t.bodies[i], t.devices[i], table)
            begin_sensor(t.bodies[i], t.devices[i], table)
            asking = t.bodies[i]
            asking.asked = -1
    at = 0
    size = len(out)
    while slot < o.end and at < size:
        # sense
        for i in range(r.axes):
            m = x.samples[i]
            b = t.bodies[i]
            d = t.devices[i]
            n = x.params[i].divisor
            if n > 1 and not ask_device(m, b, d, n, slot, table):
                continue
            while n == 1 and b.slot < slot:
                pass_device(b, d, table)
            sense_device(m, b, d, table, t.flags)
            check_sample(r, o, x.params[i], x.axes, m, slot, i)
        # close, exchange and think
        if not run_cycle(r, o, x, slot, skipped, steps):
            return cycle - began
        # act and record
        whole = f.measured < 0
        if whole:
            out[at] = slot * r.period_ns * 1e-9
            out[at + 1] = 0.0
            out[at + 2] = 0.0
            out[at + 3] = float(skipped)
            at = at + 4
            for k in range(r.pairs):
                at = fill_pair(out, at, pair_at(x, k), steps)
        for i in range(r.axes):
            if is_due(x.params[i], slot):
                command_device(t.bodies[i], t.devices[i], x.axes[i].command)
            if whole:
                at = fill_device(out, at, t.bodies[i], t.devices[i])
        if not whole:
            at = fill_measured(out, at, pair_at(x, f.measured), t.bodies, t.devices)
        # sleep
        slot = slot + 1
        skipped = 0
        if f.overruns and t.flags[cycle]:
            skipped = f.overrun_slots
            slot = slot + skipped
            if skipped >= r.overrun_limit:
                begin_stop(r, o, x.axes, slot, OVERRUN, 0, skipped)
        cycle = cycle + 1
    if slot < o.end:
        o.done = cycle
        o.next_slot = slot
        o.skipped = skipped
    return cycle - began


STEPS: Any = None
"""Takes the place of a coupling's steps in what is compiled: its own, compiled."""


def run_law(t: Any) -> int:
    """Run all cycles with the steps that are compiled in."""
    return run_rig(t, STEPS)
