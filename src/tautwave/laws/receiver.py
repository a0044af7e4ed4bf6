"""Receiver of waves over any network: plays slots in time, and never gives more than came.

The sender counts wave integral I and energy E from the start of the session; each packet carries
its slot and both counters, so that a packet replaces all older ones. The receiver follows I with
a pointer on its own slot grid and gives out what I grew by, as long as energy lasts:

    B     = I(pointer) - I_out                       backlog
    want  = timely + repay (B - timely)              timely: growth of this tick, see `advance`
    funds = E(pointer) + granted - E_out + reserve
    |out| <= sqrt(funds / K),  and  |out| <= funds / (K |B|)  above half of that

with K of `counters.energy_scale`. E_out + charge <= E_in + reserve is a comparison of integers: no
pattern of delay, loss, duplication, reordering or clocks can make it false, since E only grows.

- In time and on equal rates nothing is cut: then funds are K growth**2 at least, B is the growth.
- The second bound makes energy last as long as the backlog: without it the first tick after an
  outage spends all. Let n be the least number with B**2 <= n av / K: another wave of the sender
  keeps it with n + 1, and out = B / n brings it to n again. So positions meet.
- Nothing is extrapolated. Between received slots I and E are straight lines, which by Cauchy and
  Schwarz cost no more than what was sent; what is missing is not invented.
- The pointer stays on the grid: between slots it would average neighbours, a low-pass that takes
  energy the sender paid.

Sources: Chopra & Spong, IEEE CDC 2003 (waves over unreliable networks); Secchi, Stramigioli &
Fantuzzi 2003 (packet loss); Hirche & Buss 2004 (energy-checked reconstruction). The integer
counters, the two bounds and play-out of an integral are derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.counters import ENERGY_QUANTUM, WAVE_QUANTUM, energy_scale

LOWEST = -(1 << 52)
"""Less than any lead."""
OUTAGE_SLOTS = 40
"""Slots of lag beyond the depth at which the pointer jumps instead of slipping."""
BLOCK_S = 0.25
"""Time over which the least delay is looked for [s]: longer than bursts, shorter than drifts."""


class ReceiverParams(NamedTuple):
    """Constants of a receiver; times in steps of its pointer, `up` to a slot of the sender.

    period T of a tick [s]; newest: play what came last, without a buffer; up, down: a tick is
    down / up slots, one of them 1; depth: distance to the newest slot at its best, to begin with;
    deepest: as far as it may grow by itself; slack: how far off the pointer may be; far: how late
    is an outage; block, watch: ticks over which the best, and the share of dry ticks, are taken;
    repay: share of the old backlog per tick; fastest: most of it per tick [wave quanta]; scale K;
    reserve, level [energy quanta]: what it starts with; what it keeps beyond.
    """

    period: float
    newest: bool
    up: int
    down: int
    depth: int
    deepest: int
    slack: int
    far: int
    block: int
    watch: int
    repay: float
    fastest: float
    scale: float
    reserve: int
    level: int


def receiver_params(
    period: float,
    *,
    sender_period: float,
    depth: float,
    deepest: float = 0.0,
    newest: bool = False,
    repay_time: float = 0.02,
    fastest: float = math.inf,
    reserve: float = 1e-6,
    level: float = 1e-3,
) -> ReceiverParams:
    """Return the constants of a receiver.

    Parameters
    ----------
    period, sender_period : float
        Tick of the receiver and slot of the sender [s]; one is a whole number of the other.
    depth, deepest : float
        Play-out depth [s], rounded to slots of the sender; up to which it follows what the network
        needs, at or below `depth`: it stays.
    newest : bool
        Whether to play what came last instead: quicker by the depth, and rougher.
    repay_time : float
        Time constant in which backlog is repaid [s].
    fastest : float
        Greatest wave [W**0.5] by which it is repaid: sqrt(2 b) times a velocity.
    reserve, level : float
        Energy [J] it starts with; energy that it keeps beyond for slips and slow senders.
    """
    up = max(1, round(sender_period / period))
    down = max(1, round(period / sender_period))
    return ReceiverParams(
        period,
        newest,
        up,
        down,
        up * round(depth / sender_period),
        up * round(max(depth, deepest) / sender_period),
        max(up, down),
        OUTAGE_SLOTS * up,
        max(1, round(BLOCK_S / period)),
        max(1, round(WATCH_S / period)),
        period / (period + repay_time),
        min(fastest * period / WAVE_QUANTUM, 2.0**51),
        energy_scale(period),
        math.floor(reserve / ENERGY_QUANTUM),
        math.floor(level / ENERGY_QUANTUM),
    )


WATCH_S = 10.0
"""Time over which the share of dry ticks is taken, and after which the depth may shrink [s]."""
DRY = 0.01
"""Share of ticks that may be dry: the depth follows the 99th percentile of the delays."""


def watched(p: ReceiverParams, share: float, happened: bool, since: int) -> float:
    """Return the share of the last ticks in which something happened [1].

    `since` is how many there were before: a mean of all at first, a fading one from `watch` on.
    """
    count = since + 1
    if count > p.watch:
        count = p.watch
    if happened:
        return share + (1.0 - share) / count
    return share - share / count


def adapt_depth(
    p: ReceiverParams, depth: int, best: int, dry: float, thin: float, since: int
) -> int:
    """Return the depth from a block's end on.

    Parameters
    ----------
    p : ReceiverParams
        Constants.
    depth, best : int
        Depth so far; greatest lead in the block, which grew while the pointer waited.
    dry, thin : float
        Shares of ticks [1] without a slot to play, and of those that would have been with a
        slot less.
    since : int
        Ticks since the depth last changed.

    Notes
    -----
    Raised to what the waiting has made of it; lowered by a slot at a time.
    """
    if dry > DRY and best > depth:
        return min(best, p.deepest)
    if thin < 0.5 * DRY and since > p.watch and depth > 0:
        return depth - min(depth, p.up)
    return depth


def advance(
    p: ReceiverParams, depth: int, ahead: int, best: int, ticks: int, owed: int
) -> tuple[int, int, int, int, int]:
    """Choose how far the pointer moves in a tick.

    Parameters
    ----------
    p : ReceiverParams
        Constants.
    depth : int
        Present play-out depth.
    ahead : int
        Steps from the pointer to the newest slot.
    best, ticks, owed : int
        Greatest lead in this block, ticks of it so far, slips still to make.

    Returns
    -------
    tuple of int
        Steps to move; how many of the first are in time, -1: the last growth is repeated; and the
        new best, ticks and owed.

    Notes
    -----
    Starved it waits, and the delay grows. Far behind, after an outage, it jumps and all that it
    passed is backlog. Else it slips by a step per tick where the least delay has changed.
    """
    if p.newest:
        return ahead, ahead, LOWEST, 0, 0
    lead = ahead - p.down
    if lead > depth + p.far:
        return ahead - depth, 0, LOWEST, 0, 0
    step = p.down
    timely = p.down
    if owed > 0:
        step = p.down + 1
        owed = owed - 1
    elif owed < 0:
        step = p.down - 1
        timely = -1
        owed = owed + 1
    else:
        if lead > best:
            best = lead
        ticks = ticks + 1
        if ticks >= p.block:
            excess = best - depth
            if excess > p.slack or excess < -p.slack:
                owed = excess
            best = LOWEST
            ticks = 0
    if step > ahead:
        step = ahead
        timely = ahead
    return step, timely, best, ticks, owed


def part_of(change: int, steps: int, whole: int) -> int:
    """Return the share steps / whole of a counter's change, exact where it is all of it."""
    if steps >= whole:
        return change
    return int(change * (steps / whole))


def output_wave(p: ReceiverParams, funds: int, backlog: int, timely: int) -> int:
    """Return the wave to give out in a tick [wave quanta], paid by the funds [energy quanta]."""
    if funds <= 1:
        return 0
    mend = p.repay * (backlog - timely)
    if mend > p.fastest:
        mend = p.fastest
    elif mend < -p.fastest:
        mend = -p.fastest
    want = timely + mend
    # One quantum less: what is charged is rounded up.
    most = math.sqrt((funds - 1) / p.scale) * (1.0 - 1e-12)
    if math.fabs(want) > 0.5 * most and backlog != 0:
        lasting = (funds - 1) / (p.scale * math.fabs(backlog))
        if lasting < most:
            most = lasting
    if want > most:
        want = most
    elif want < -most:
        want = -most
    return int(want)


def surplus(p: ReceiverParams, funds: int, backlog: int) -> int:
    """Return what the funds hold beyond all that could be needed [energy quanta]."""
    need = p.reserve + p.level + p.scale * (1.0 * backlog * backlog)
    if funds <= need:
        return 0
    return funds - math.ceil(need)
