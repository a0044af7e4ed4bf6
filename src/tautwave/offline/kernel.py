"""A whole run on the fake clock: `runtime.loop` without anything that can be late.

Written in the subset that plain Python, numba and the translator to C share. The order of every
operation is that of the live path, so the rows are equal to the bit.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence

from tautwave.offline.couple import arm_side, meet, mismatch, skip_slot, start_pair
from tautwave.offline.device import aim_hand, command_body, measure_body, pass_body
from tautwave.offline.rates import is_due, pass_rated
from tautwave.offline.records import (
    BROKEN,
    FINISHED,
    GUARD,
    MISMATCH,
    MISSING,
    NOT_ARMED,
    OVERRUN,
    SERVO,
    Body,
    Couple,
    DeviceParams,
    Outcome,
    PairParams,
    RunParams,
    Side,
    SideParams,
)
from tautwave.offline.rows import fill_body, fill_measured, fill_pair
from tautwave.offline.side import close_side, decide_side, pass_side, start_side


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
) -> bool:
    """Begin a passive stop; return True if this is the first reason, which is the one kept."""
    for i in range(r.axes):
        s = sides[i]
        s.stopping = True
    end = slot + 1 + r.release_cycles
    if end < o.end:
        o.end = end
    if o.kind != FINISHED:
        return False
    o.kind = kind
    o.slot = slot
    o.which = which
    o.code = code
    return True


def lose(r: RunParams, o: Outcome, sides: Sequence[Side], b: Body, slot: int, which: int) -> None:
    """Count an axis without a usable sample; stop if it is a broken one or one too many."""
    if b.valid:
        b.valid = False
        if begin_stop(r, o, sides, slot, BROKEN, which, 0):
            o.first = b.position
            o.second = b.effort
    s = sides[which]
    s.missing += 1
    if s.missing == r.missing_limit and o.kind == FINISHED:
        begin_stop(r, o, sides, slot, MISSING, which, s.missing)


def ask_body(b: Body, d: DeviceParams, n: int, slot: int, table: MutableSequence[float]) -> bool:
    """Serve a device on a bus of divisor `n`; return whether a sample is to be read now."""
    exchange = slot // n
    phase = slot % n
    if b.asked >= 0 and b.asked < exchange:
        b.reads += 1  # drained: nobody looks at it
        b.asked = -1
        b.valid = False
    if b.asked < 0 and (phase == 0 or 2 * (phase + 1) <= n):
        while b.slot < exchange:
            pass_body(b, d, table)
        b.asked = exchange
    if phase < n - 1:
        return False
    if b.asked < 0:
        b.valid = False
        return False
    b.asked = -1
    return True


def engage(
    r: RunParams,
    o: Outcome,
    params: Sequence[SideParams],
    sides: Sequence[Side],
    bodies: Sequence[Body],
    pairs: Sequence[PairParams],
    couples: Sequence[Couple],
    table: MutableSequence[float],
    slot: int,
) -> bool:
    """Start the pairs at what is measured; return False if the run must not begin."""
    if o.kind != FINISHED:
        return True
    armed = True
    for k in range(r.pairs):
        q = pairs[k]
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
        start_pair(couples[k], q, one, two, p1, p2, master, slave, table)
        armed = arm_side(one, p1, r.arm_share) and arm_side(two, p2, r.arm_share) and armed
    if armed:
        o.armed_at = slot
    elif slot * r.period_ns > r.arm_timeout_ns:
        o.kind = NOT_ARMED
        o.slot = slot
        return False
    return True


def stop_on_guard(
    r: RunParams, o: Outcome, sides: Sequence[Side], pairs: Sequence[PairParams], slot: int
) -> None:
    """Stop because a limit was passed; the first axis that did is named."""
    for k in range(2 * r.pairs):
        which = pairs[k // 2].master
        if k % 2 == 1:
            which = pairs[k // 2].slave
        s = sides[which]
        if s.guard != 0 and o.kind == FINISHED:
            begin_stop(r, o, sides, slot, GUARD, which, s.guard)
            o.first = s.position
            o.second = s.velocity


def run_rig(
    runs: Sequence[RunParams],
    outcomes: Sequence[Outcome],
    params: Sequence[SideParams],
    sides: Sequence[Side],
    devices: Sequence[DeviceParams],
    bodies: Sequence[Body],
    pairs: Sequence[PairParams],
    couples: Sequence[Couple],
    table: MutableSequence[float],
    flags: Sequence[bool],
    out: MutableSequence[float],
) -> int:
    """Run all cycles; return how many rows were written into `out`, one after the other.

    The loops over axes and pairs stand here and not in functions of their own, because handing
    on a table costs numba as much as a small law.
    """
    r = runs[0]
    o = outcomes[0]
    o.end = r.cycles
    o.armed_at = -1
    for i in range(r.axes):
        start_side(sides[i], params[i], 0.0, math.nan, 0.0)
        aim_hand(bodies[i], devices[i], table)
        asking = bodies[i]
        asking.asked = -1
    at = 0
    slot = 0
    cycle = 0
    skipped = 0
    while slot < o.end:
        # sense
        for i in range(r.axes):
            b = bodies[i]
            d = devices[i]
            n = params[i].divisor
            if n > 1 and not ask_body(b, d, n, slot, table):
                continue
            while n == 1 and b.slot < slot:
                pass_body(b, d, table)
            noise = 0.0
            if d.position_noise > 0.0:
                noise = table[d.noise + b.reads]
            measure_body(b, d, noise, d.loses and flags[d.missing + b.reads])
            b.reads += 1
            total = b.position
            if d.kind == SERVO:
                total = total + b.effort
            if b.valid and total - total == 0.0:
                s = sides[i]
                s.missing = 0
            else:
                lose(r, o, sides, b, slot, i)
        # close
        if o.armed_at >= 0:
            for passed in range(skipped + 1):
                if passed > 0:
                    for k in range(r.pairs):
                        q = pairs[k]
                        one = sides[q.master]
                        two = sides[q.slave]
                        p1 = params[q.master]
                        if not q.rated:
                            skip_slot(couples[k], q, one, two, p1, params[q.slave], table)
                for i in range(r.axes):
                    if not params[i].rated:
                        pass_side(sides[i], params[i], table)
            for i in range(r.axes):
                s = sides[i]
                b = bodies[i]
                if params[i].rated:
                    continue
                if b.valid:
                    close_side(s, params[i], b.position, b.effort)
                else:
                    s.valid = False
                    s.leaving = 0.0
            for k in range(r.pairs):
                q = pairs[k]
                one = sides[q.master]
                two = sides[q.slave]
                p1 = params[q.master]
                p2 = params[q.slave]
                if q.rated:
                    for passed in range(skipped + 1):
                        seen = passed == skipped
                        at_slot = slot - skipped + passed
                        master = bodies[q.master]
                        slave = bodies[q.slave]
                        c = couples[k]
                        pass_rated(c, q, one, two, p1, p2, master, slave, table, at_slot, seen)
        elif not engage(r, o, params, sides, bodies, pairs, couples, table, slot):
            return cycle
        # exchange and think
        if o.armed_at >= 0:
            fresh = o.armed_at == slot
            for k in range(r.pairs):
                q = pairs[k]
                one = sides[q.master]
                two = sides[q.slave]
                p1 = params[q.master]
                if fresh or not q.rated:
                    meet(couples[k], q, one, two, p1, params[q.slave], table, fresh)
            ramp = ramp_share(r, o, slot)
            guarded = False
            for i in range(r.axes):
                s = sides[i]
                s.guard = 0
                # A slow side thinks when it is served next.
                if params[i].divisor == 1 or (is_due(params[i], slot) and not fresh):
                    s.guard = decide_side(s, params[i], table, bodies[i].valid, ramp)
                if s.guard != 0:
                    guarded = True
            if guarded and not fresh and o.kind == FINISHED:
                stop_on_guard(r, o, sides, pairs, slot)
        # act and record
        whole = r.measured < 0
        if whole:
            out[at] = slot * r.period_ns * 1e-9
            out[at + 1] = 0.0
            out[at + 2] = 0.0
            out[at + 3] = float(skipped)
            at = at + 4
            for k in range(r.pairs):
                q = pairs[k]
                one = sides[q.master]
                two = sides[q.slave]
                p1 = params[q.master]
                at = fill_pair(out, at, couples[k], q, one, two, p1, params[q.slave], table)
        for i in range(r.axes):
            if is_due(params[i], slot):
                command_body(bodies[i], devices[i], sides[i].command)
            if whole:
                at = fill_body(out, at, bodies[i], devices[i])
        if not whole:
            q = pairs[r.measured]
            one = sides[q.master]
            two = sides[q.slave]
            b1 = bodies[q.master]
            b2 = bodies[q.slave]
            d1 = devices[q.master]
            d2 = devices[q.slave]
            at = fill_measured(out, at, couples[r.measured], q, one, two, b1, b2, d1, d2)
        # sleep
        slot = slot + 1
        skipped = 0
        if r.overruns and flags[cycle]:
            skipped = r.overrun_slots
            slot = slot + skipped
            if skipped >= r.overrun_limit:
                begin_stop(r, o, sides, slot, OVERRUN, 0, skipped)
        cycle = cycle + 1
    return cycle
