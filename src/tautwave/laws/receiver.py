"""Receiver of waves over any network: plays slots in time, and never gives more than came.

The sender counts wave integral I and energy E from the start of the session; each packet carries
its slot and both counters, so that a packet replaces all older ones. The receiver follows I with
a pointer on its own slot grid and gives out what I grew by, as long as energy lasts:

    timely = growth of this tick, see `advance`
    rest   = I(pointer) - I_out - timely               what is owed
    funds  = E(pointer) + granted - E_out + reserve
    out    = timely + mend,  |out| <= sqrt(funds / K)
    mend  <= repay |rest|,  and  mend <= (funds - K timely**2) / (K |rest|) - 2 timely

with K of `counters.energy_scale`, signs as seen along the debt. E_out + charge <= E_in + reserve is
a comparison of integers: no pattern of delay, loss, duplication, reordering or clocks can make it
false, since E only grows.

- In time and on equal rates nothing is cut: then funds are K timely**2 at least, nothing is owed.
- Owing costs nothing: what is in time passes, since its energy came with it. Paying a share s of
  the debt costs K mend (mend + 2 timely) <= s (funds - K timely**2): the energy for each count of
  the debt never falls, so a debt waits until the waves in time are smaller or run against it, and
  is payable then. Positions meet as soon as waves have no mean.
- A debt of a force that was held comes with the work of both slips, and what is paid for it at
  little force leaves more for the rest: the force comes back as far as that work does. Where energy
  is short of it, what is in time is cut to its mean: what noise carries pays the debt. It is never
  cut below, nor by more than what keeps the energy for each count of the debt.
- Nothing is extrapolated. Between received slots I and E are straight lines, which by Cauchy and
  Schwarz cost no more than what was sent; what is missing is not invented.
- The pointer stays on the grid: between slots it would average neighbours, a low-pass that takes
  energy the sender paid.

Sources: Chopra & Spong, IEEE CDC 2003 (waves over unreliable networks); Secchi, Stramigioli &
Fantuzzi 2003 (packet loss); Hirche & Buss 2004 (energy-checked reconstruction). The integer
counters, the bounds and play-out of an integral are derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.counters import ENERGY_QUANTUM, WAVE_QUANTUM, energy_scale

LOWEST = -(1 << 52)
"""Less than any lead."""
OUTAGE_SLOTS = 40
"""Slots of lag beyond the depth at which the pointer jumps instead of slipping."""
RESERVE = 1e-6
"""What a receiver starts with, for rounding and slips [J]."""
SMOOTH_S = 0.005
"""Time over which the waves' mean is taken [s]: beyond noise, within a hand's motion."""
BLOCK_S = 0.25
"""Time over which the least delay is looked for [s]: longer than bursts, shorter than drifts."""


class ReceiverParams(NamedTuple):
    """Constants of a receiver; times in steps of its pointer, `up` to a slot of the sender.

    period T of a tick [s]; newest: play what came last, without a buffer; up, down: a tick is
    down / up slots, one of them 1; depth: distance to the newest slot at its best, to begin with;
    deepest: as far as it may grow by itself; slack: how far off the pointer may be; far: how late
    is an outage; block, watch: ticks over which the best, and the share of dry ticks, are taken;
    repay: share of the debt per tick; smooth: of what comes in its mean; fastest: most of the
    debt per tick [wave quanta]; scale K; reserve, level [energy quanta]: what it starts with; what
    it keeps beyond.
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
    smooth: float
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
    reserve: float = RESERVE,
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
        period / (period + SMOOTH_S),
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


def timely_wave(p: ReceiverParams, growth: int, came: int) -> int:
    """Return how much of a tick's growth is in time [wave quanta].

    What the energy that came with it pays at once: all of it, unless several ticks' growth came
    together. The rest is owed.
    """
    cost = p.scale * (1.0 * growth * growth)
    if cost <= came + 2.0:
        return growth
    return int(growth * (came / cost))


def wanted_wave(p: ReceiverParams, rest: int, timely: int) -> float:
    """Return the wave that a tick should give out: what is in time, and a share of the `rest`."""
    mend = p.repay * rest
    if mend > p.fastest:
        mend = p.fastest
    elif mend < -p.fastest:
        mend = -p.fastest
    return timely + mend


def output_wave(
    p: ReceiverParams, funds: int, rest: int, timely: int, mean: float, want: float
) -> int:
    """Return as much of a wanted wave as the funds pay [wave quanta, energy quanta].

    A debt is paid as long as the energy beyond what is in time lasts as long as it does. Where it
    does not, what is in time is cut to its `mean`, never below.
    """
    if funds <= 1:
        return 0
    # One quantum less: what is charged is rounded up.
    funds = funds - 1
    most = math.sqrt(funds / p.scale) * (1.0 - 1e-12)
    sign = 1.0
    if rest < 0:
        sign = -1.0
    wave = sign * timely
    if wave > most:
        wave = most
    elif wave < -most:
        wave = -most
    if rest != 0:
        owed = math.fabs(rest)
        room = (funds / p.scale - wave * wave) / owed - 2.0 * wave
        if room < 0.0:
            least = max(0.0, sign * mean, room + wave)
            if wave > least:
                owed = owed + (wave - least)
                wave = least
                room = (funds / p.scale - wave * wave) / owed - 2.0 * wave
        mend = sign * (want - timely)
        if mend > room:
            mend = room
        if mend > 0.0:
            wave = wave + mend
            if wave > most:
                wave = most
    return int(sign * wave)


def surplus(p: ReceiverParams, funds: int, backlog: int) -> int:
    """Return what the funds hold beyond all that could be needed [energy quanta]."""
    need = p.reserve + p.level + p.scale * (1.0 * backlog * backlog)
    if funds <= need:
        return 0
    return funds - math.ceil(need)
