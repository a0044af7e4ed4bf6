"""A run from the first sample to the last command: engaging, ramps, guards, and ways to stop."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tautwave.controller.axis import is_balanced, is_calm, start_axis
from tautwave.controller.pair import cycle_pair, engage_pair, mismatch, pair_at, start_pair
from tautwave.controller.records import (
    BROKEN,
    FINISHED,
    GUARD,
    MISMATCH,
    MISSING,
    NOT_ARMED,
    UNBALANCED,
    AxisParams,
    AxisState,
    RunParams,
    RunState,
    RunView,
    Sample,
)
from tautwave.controller.steps import Steps


def begin_run(
    r: RunParams, o: RunState, params: Sequence[AxisParams], axes: Sequence[AxisState]
) -> None:
    """Begin with every axis at 0, not engaged."""
    o.end = r.cycles
    o.armed_at = -1
    for i in range(r.axes):
        start_axis(axes[i], params[i], 0.0, 0.0)


def ramp_share(r: RunParams, o: RunState, slot: int) -> float:
    """Return the share of the limits allowed in this slot, 0 to 1."""
    share = 1.0
    rise = slot + 1 - o.armed_at
    if rise < r.engage_cycles:
        share = rise / r.engage_cycles
    left = o.end - slot
    if left < r.release_cycles:
        share = share * (left / r.release_cycles)
    return share


def end_by(r: RunParams, o: RunState, slot: int) -> None:
    """Let the run end after the ramp down that begins in the slot after this one."""
    end = slot + 1 + r.release_cycles
    if end < o.end:
        o.end = end


def begin_stop(
    r: RunParams,
    o: RunState,
    axes: Sequence[AxisState],
    slot: int,
    kind: int,
    which: int,
    code: int,
) -> bool:
    """Begin a passive stop: certified damping instead of coupling, ramped to zero.

    Returns
    -------
    bool
        Whether this is the first reason: that one is kept.
    """
    for i in range(r.axes):
        s = axes[i]
        s.stopping = True
    end_by(r, o, slot)
    if o.kind != FINISHED:
        return False
    o.kind = kind
    o.slot = slot
    o.which = which
    o.code = code
    return True


def forget_stop(o: RunState, end: int) -> None:
    """Withdraw a stop whose reason ended only a session or an engagement: the run goes on."""
    fresh = RunState(end=end, armed_at=o.armed_at)
    for key in RunState.__slots__:
        setattr(o, key, getattr(fresh, key))


def check_sample(
    r: RunParams,
    o: RunState,
    p: AxisParams,
    axes: Sequence[AxisState],
    m: Sample,
    slot: int,
    which: int,
) -> None:
    """Look at what an exchange brought of an axis; stop for what is broken or missing too often.

    The only door by which numbers of devices reach the laws: behind it a valid sample is finite.
    A broken sample, one that is not, counts as missing, and begins the stop at once, with the
    numbers that were read. Missing ones are counted in a row; the run stops when they are
    `missing_limit`. An impedance axis needs an effort only where its coupling is `fed` by it, and
    may lack it as often as a sample. The first reason to stop stays: later ones follow from it.
    """
    s = axes[which]
    if p.senses:
        m.effort = p.sensor_gain * (m.effort - p.sensor_zero)
        if m.valid and m.effort - m.effort == 0.0:
            s.outside = m.effort
    total = m.position
    if not p.impedance:
        total = total + m.effort
    broken = m.valid and total - total != 0.0
    usable = m.valid and not broken
    if usable and p.fed and m.effort - m.effort != 0.0:
        usable = False
        broken = s.missing + 1 >= r.missing_limit
    if usable:
        s.missing = 0
        return
    m.valid = False
    if broken and begin_stop(r, o, axes, slot, BROKEN, which, 0):
        o.first = m.position
        o.second = m.effort
    s.missing += 1
    if s.missing == r.missing_limit and o.kind == FINISHED:
        begin_stop(r, o, axes, slot, MISSING, which, s.missing)


def start_pairs(r: RunParams, o: RunState, x: RunView, slot: int, steps: Steps) -> bool:
    """Start the pairs at the measured positions; return whether all their efforts are small there.

    A pair that starts too far from its offset ends the run: `MISMATCH`. An effort sensor that shows
    more than friction balances keeps them from starting: somebody pushes, or its offset is wrong.
    """
    armed = True
    o.code = 0
    for k in range(r.pairs):
        pair = pair_at(x, k)
        q = pair.q
        master = x.samples[q.master]
        slave = x.samples[q.slave]
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
        start_pair(pair, master, slave, steps)
        armed = is_calm(pair.one, pair.p1, r.arm_share) and armed
        armed = is_calm(pair.two, pair.p2, r.arm_share) and armed
        for which in (q.master, q.slave):
            if not is_balanced(x.axes[which], x.params[which]):
                armed = False
                o.code = UNBALANCED
                o.which = which
                o.found = x.axes[which].outside
    return armed


def arm(r: RunParams, o: RunState, slot: int, armed: bool) -> bool:
    """Begin the engage ramp if all is calm; return False if the run must not begin any more."""
    if o.kind != FINISHED:
        return False
    if armed:
        o.armed_at = slot
    elif slot * r.period_ns > r.arm_timeout_ns:
        o.kind = NOT_ARMED
        o.slot = slot
        return False
    return True


def stop_on_guard(
    r: RunParams, o: RunState, axes: Sequence[AxisState], slot: int, which: int
) -> None:
    """Stop if the guard of an axis says that a limit was passed; the first one is kept."""
    s = axes[which]
    if s.guard != 0 and o.kind == FINISHED:
        begin_stop(r, o, axes, slot, GUARD, which, s.guard)
        o.first = s.position
        o.second = s.velocity
        o.found = s.found
        o.allowed = s.allowed


def run_cycle(r: RunParams, o: RunState, x: RunView, slot: int, skipped: int, steps: Steps) -> bool:
    """Close, exchange and compute on every pair, or engage; return False if the run must not begin.

    `skipped` slots went by unseen before this one. Until all axes have delivered samples nothing
    is coupled; then all pairs engage in one slot, so that none pulls at another's arm while that
    one is still free, and the ramp rises from this slot on. Pairs share no state, and their order
    changes no bit. Guards are looked at when all pairs are through: the commands of this cycle
    are then those of one moment, and the stop begins on all axes in the same slot.
    """
    if o.armed_at < 0:
        if o.kind != FINISHED:
            return True  # a stop has begun: nothing engages any more
        armed = start_pairs(r, o, x, slot, steps)
        if not arm(r, o, slot, armed):
            return False
        if o.armed_at < 0:
            return True
        rise = ramp_share(r, o, slot)
        for k in range(r.pairs):
            engage_pair(pair_at(x, k), rise, steps)
        return True
    ramp = ramp_share(r, o, slot)
    guards = 0
    for k in range(r.pairs):
        pair = pair_at(x, k)
        q = pair.q
        master = x.samples[q.master]
        slave = x.samples[q.slave]
        guards += cycle_pair(pair, master, slave, slot, skipped, ramp, steps)
    if guards != 0:
        for k in range(r.pairs):
            q = x.pairs[k]
            stop_on_guard(r, o, x.axes, slot, q.master)
            stop_on_guard(r, o, x.axes, slot, q.slave)
    return True
