"""A whole run on the fake clock: `runtime.loop` without anything that can be late.

Written in the subset that plain Python, numba and the translator to C share. The order of every
operation is that of the live path, so the rows are equal to the bit.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from tautwave.offline.couple import (
    arm_side,
    cycle_states,
    cycle_waves,
    engage_pair,
    mismatch,
    start_pair,
)
from tautwave.offline.device import command_body, measure_body, pass_body
from tautwave.offline.records import (
    FINISHED,
    GUARD,
    MISMATCH,
    MISSING,
    NOT_ARMED,
    OVERRUN,
    Body,
    Couple,
    DeviceParams,
    Outcome,
    PairParams,
    RunParams,
    Side,
    SideParams,
)
from tautwave.offline.rows import fill_body, fill_pair
from tautwave.offline.side import start_side


def ramp_share(r: RunParams, o: Outcome, slot: int) -> float:
    """Return the share of the limits allowed in this slot, 0 to 1."""
    share = 1.0
    rise = slot + 1 - o.armed_at
    if rise < r.engage_cycles:
        share = rise / r.engage_cycles
    left = o.end - slot
    if left < r.release_cycles:
        share = share * (left / r.release_cycles)
    return share


def begin_stop(
    r: RunParams, o: Outcome, sides: Sequence[Side], slot: int, kind: int, which: int, code: int
) -> None:
    """Begin a passive stop; only the first reason is kept."""
    if o.kind == FINISHED:
        o.kind = kind
        o.slot = slot
        o.which = which
        o.code = code
    for i in range(r.axes):
        s = sides[i]
        s.stopping = True
    end = slot + 1 + r.release_cycles
    if end < o.end:
        o.end = end


def sense(
    r: RunParams,
    o: Outcome,
    sides: Sequence[Side],
    bodies: Sequence[Body],
    devices: Sequence[DeviceParams],
    references: Sequence[float],
    noise: Sequence[float],
    missing: Sequence[bool],
    pipes: MutableSequence[float],
    slot: int,
    cycle: int,
) -> None:
    """Bring every device to this slot and measure it; count what is missing."""
    for i in range(r.axes):
        b = bodies[i]
        d = devices[i]
        while b.slot < slot:
            pass_body(b, d, references, pipes)
        measure_body(b, d, cycle, references, noise, missing)
        s = sides[i]
        if b.valid:
            s.missing = 0
        else:
            s.missing += 1
            if s.missing == r.missing_limit and o.kind == FINISHED:
                begin_stop(r, o, sides, slot, MISSING, i, s.missing)


def engage(
    r: RunParams,
    o: Outcome,
    params: Sequence[SideParams],
    sides: Sequence[Side],
    bodies: Sequence[Body],
    pairs: Sequence[PairParams],
    couples: Sequence[Couple],
    pipes: MutableSequence[float],
    lines: MutableSequence[float],
    slot: int,
) -> bool:
    """Start the pairs at what is measured; return False if the run must not begin."""
    armed = True
    for k in range(r.pairs):
        q = pairs[k]
        c = couples[k]
        master = bodies[q.master]
        slave = bodies[q.slave]
        if not (master.valid and slave.valid):
            armed = False
            continue
        if not q.at_engage:
            gap = mismatch(q, master.position, slave.position, q.offset)
            if math.fabs(gap) > q.tolerance:
                o.kind = MISMATCH
                o.slot = slot
                o.which = k
                o.first = gap
                return False
        one = sides[q.master]
        two = sides[q.slave]
        p1 = params[q.master]
        p2 = params[q.slave]
        start_pair(c, q, one, two, p1, p2, master, slave, lines)
        armed = (
            arm_side(one, p1, r.arm_share) and arm_side(two, p2, r.arm_share) and armed
        )
    if armed:
        o.armed_at = slot
        ramp = ramp_share(r, o, slot)
        for k in range(r.pairs):
            q = pairs[k]
            engage_pair(
                couples[k],
                q,
                sides[q.master],
                sides[q.slave],
                params[q.master],
                params[q.slave],
                pipes,
                lines,
                ramp,
            )
    elif slot * r.period_ns > r.arm_timeout_ns:
        o.kind = NOT_ARMED
        o.slot = slot
        return False
    return True


def couple_all(
    r: RunParams,
    o: Outcome,
    params: Sequence[SideParams],
    sides: Sequence[Side],
    bodies: Sequence[Body],
    pairs: Sequence[PairParams],
    couples: Sequence[Couple],
    pipes: MutableSequence[float],
    lines: MutableSequence[float],
    slot: int,
    skipped: int,
) -> None:
    """Close, exchange and think on every pair; stop on the first guard that speaks."""
    ramp = ramp_share(r, o, slot)
    guarded = False
    for k in range(r.pairs):
        q = pairs[k]
        c = couples[k]
        one = sides[q.master]
        two = sides[q.slave]
        p1 = params[q.master]
        p2 = params[q.slave]
        master = bodies[q.master]
        slave = bodies[q.slave]
        if q.by_wave:
            c.guard = cycle_waves(
                c, q, one, two, p1, p2, master, slave, pipes, lines, skipped, ramp
            )
        else:
            c.guard = cycle_states(
                c, q, one, two, p1, p2, master, slave, pipes, lines, skipped, ramp
            )
        if c.guard != 0:
            guarded = True
    if guarded and o.kind == FINISHED:
        for k in range(r.pairs):
            code = couples[k].guard
            if code != 0 and o.kind == FINISHED:
                which = pairs[k].master
                if code % 8 == 0:
                    which = pairs[k].slave
                    code = code // 8
                begin_stop(r, o, sides, slot, GUARD, which, code % 8)
                o.first = sides[which].position
                o.second = sides[which].velocity


def run_rig(
    runs: Sequence[RunParams],
    outcomes: Sequence[Outcome],
    params: Sequence[SideParams],
    sides: Sequence[Side],
    devices: Sequence[DeviceParams],
    bodies: Sequence[Body],
    pairs: Sequence[PairParams],
    couples: Sequence[Couple],
    references: Sequence[float],
    noise: Sequence[float],
    missing: Sequence[bool],
    overruns: Sequence[bool],
    pipes: MutableSequence[float],
    lines: MutableSequence[float],
    out: MutableSequence[float],
) -> int:
    """Run all cycles; return how many rows were written into `out`, one after the other."""
    r = runs[0]
    o = outcomes[0]
    o.end = r.cycles
    o.armed_at = -1
    for i in range(r.axes):
        start_side(sides[i], params[i], 0.0, math.nan, 0.0)
    at = 0
    slot = 0
    cycle = 0
    skipped = 0
    while slot < o.end:
        sense(r, o, sides, bodies, devices, references, noise, missing, pipes, slot, cycle)
        if o.armed_at < 0:
            if not engage(r, o, params, sides, bodies, pairs, couples, pipes, lines, slot):
                return cycle
        else:
            couple_all(
                r, o, params, sides, bodies, pairs, couples, pipes, lines, slot, skipped
            )
        out[at] = slot * r.period_ns * 1e-9
        out[at + 1] = 0.0
        out[at + 2] = 0.0
        out[at + 3] = float(skipped)
        at = at + 4
        for k in range(r.pairs):
            q = pairs[k]
            at = fill_pair(
                out,
                at,
                couples[k],
                q,
                sides[q.master],
                sides[q.slave],
                params[q.master],
                params[q.slave],
                pipes,
            )
        for i in range(r.axes):
            command_body(bodies[i], devices[i], sides[i].command)
            at = fill_body(out, at, bodies[i], devices[i], references)
        slot = slot + 1
        skipped = 0
        if r.overruns and overruns[cycle]:
            skipped = r.overrun_slots
            slot = slot + skipped
            if skipped >= r.overrun_limit:
                begin_stop(r, o, sides, slot, OVERRUN, 0, skipped)
        cycle = cycle + 1
    return cycle
