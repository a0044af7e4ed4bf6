"""An energy account around any law: it bounds what may be given, and books what was given.

Any function of own and far samples asks for a resisting effort R. Held over a period it gives

    -R dx,  dx = T (v - M R),  v the mean velocity without it, M = T / (2 m), m the mass bound:

a parabola in R. `gate_bounds` are the efforts that plan to give no more than the funds; 0 is always
between them, and without funds what is left is what takes. `close_account` then books R dx itself,
which is exact for a held effort whatever the prediction was worth.

The account is net. In and out are never summed apart: noise would count as income in every period
in which it has the right sign, while the net sum telescopes.

Energy that one end takes and the other needs goes over as credit: a counter of all that was ever
sent, so that a message that is lost, late or doubled changes nothing but the time. An end sends a
share of what stands above its mark. The leader's rises from its reserve to half a tank as the
follower's tank fills, for a follower with friction needs its first energy at once. The follower's
is its full tank: were both the same, a tank could never be filled, and a law that gives at the
follower (a reflected force) would stand still. Where a spring gives back at the follower what the
law has to give back at the leader, the follower's may fall with the leader's level, from a full
tank at half a tank there: as the leader's mark is half the follower's level then, no credit goes to
and fro. While the follower's tank is not full the leader
resists its own motion: who moves pays.

How large a tank is has nothing to do with the bound below, for what is in it was taken before. A
law with a delay takes and gives back far more than a prediction errs: a tank of a few reserves cuts
it in every swing.

What is true of the energy g that an end gave, credits included, for any law, delay and hand:

    A = E0 + sum(R dx) + credit + P t - spilled,  so  g = E0 - A + P t - spilled,

and an end whose A is below -D stops: g <= E0 + D + W + P t, W what commands under way can give.
D, the debt, is E0 and what a rate limit makes of an effort that should be gone at once. P t
is what noise takes without being work: the newest sample enters the effort with a gain G, and the
next displacement with -1: -G s**2 a period, G that of what was sent (for a normal noise the mean of
the slope is all that counts, Stein 1981). It is given in every period, as the leak of a wave port
is, and a quarter more than that: given only what it loses, an account that stands at its end does
not leave it. Credits taken are never more than credits sent.

An account that is nearly empty may not end a held force. Where the gate follows the velocity of
one sample, it follows its noise with a gain of m / T**2, far above any law's, and an effort that it
cuts and lets through by turns moves the device: both take more than noise is given, and the force
is gone in seconds. So the effort is also planned on a smoothed velocity, with a tenth of the funds:
it then changes slowly, and what is given stays above what is taken. At rest it holds F with 20 (1 +
n) F**2 M T: the gate expects the last command, and n under way, to move what something holds.

Source: the account is that of passivity observers (Hannaford & Ryu 2002) and of energy tanks with
level control (Franken and others 2011); gate, marks and bound are derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

FULL = 4.0
"""Reserves that a full tank has at least."""

TANK_SHARE = 0.2
"""Of the device's kinetic energy at its velocity limit, what a full tank holds."""

LEADER_SHARE = 0.5
"""Of a full tank, what a leader keeps; the rest it sends."""

SENT_SHARE = 0.2
"""Of what stands above its mark, the share that an end sends per period."""


HELD_SHARE = 0.25
"""Of the effort that a law asks for in a second, what an end that holds lets through at least."""

PATIENCE = 2
"""Seconds in succession in which it lets less through, after which it has let go."""

APART_SHARE = 0.4
"""Of the effort that a law asks for on average, what an end lets through at least to follow."""

APART_S = 10
"""Seconds in succession in which it lets less through, and no more than before, after which the
pair is astray: what is cut is a debt of position that is not led back."""

APART_SHRUNK = 0.99
"""What is cut below this share of the least so far is being led back."""

SMOOTHED_S = 0.01
"""Time over which a velocity is smoothed [s]: slower than noise, as fast as a hand moves."""

CALM_SHARE = 0.1
"""Of the funds that a command may plan to give, what it may on that velocity."""

SURELY = 1.0 + 1e-9
"""Margin over rounding: an effort that is within by it is within the bounds as computed."""

COMMANDS_UNDER_WAY = 3.0
"""Each command under way may plan to give this share's inverse, over their number, of the funds:
each sees an account that the others have not yet drawn on. Below e, the account could go negative.
"""


class AccountParams(NamedTuple):
    """Constants of one end's account, in its device's own units.

    reserve E0, debt D, least, mark, full, capacity [J]: held at the start, allowed below 0, sent
    above while the far tank is empty, and once it has `enough` [1], reported as 1, spilled above;
    income [J per period]: what is given for noise; share of the funds that a command may plan to
    give, less than 1 where others are on their way; level_damping, 0 at a follower, and edge
    [N m s/rad or N s/m]. `friction` [N m or N], whole from `slip`
    [rad/s or m/s] on, and `drag` [N m s/rad or N s/m] of the level control on the velocity that is
    smoothed with the gain `smoothing` [1]. Over each `window`, the periods of a second, a law that
    asks for less than `felt` [N m or N] on average does not press. gain [N m/rad or N/m]: the most
    by which an effort changes with its newest sample, which the income is for.
    """

    reserve: float
    debt: float
    least: float
    mark: float
    full: float
    capacity: float
    income: float
    share: float
    level_damping: float
    edge: float
    friction: float = 0.0
    slip: float = 1.0
    drag: float = 0.0
    smoothing: float = 1.0
    enough: float = 1.0
    window: int = 1000
    felt: float = 0.0
    gain: float = 0.0


def planned_share(late: int) -> float:
    """Return the share of the funds that a command may plan to give, `late` periods ahead [1]."""
    return 1.0 if late == 0 else 1.0 / (COMMANDS_UNDER_WAY * (1 + late))


def gate_bounds(
    p: AccountParams, funds: float, free_velocity: float, half_mobility: float, period: float
) -> tuple[float, float]:
    """Return between which efforts the law may choose [N m or N].

    The funds allow +-g in all directions, g the root of the parabola that gives them away. Against
    the motion it may take more than that, as a damper `edge` would: what takes needs no funds, but
    far beyond the law's own gain it would only be fed by noise.

    Parameters
    ----------
    p : AccountParams
        Constants; `edge` is at most 1 / M.
    funds : float
        What may be given [J]; less than 0 counts as 0.
    free_velocity : float
        Mean velocity of the coming period without it [rad/s or m/s].
    half_mobility : float
        M = T / (2 m) > 0.
    period : float
        T [s].
    """
    given = 0.0
    if funds > 0.0:
        root = math.sqrt(free_velocity * free_velocity + 4.0 * half_mobility * funds / period)
        given = (root - math.fabs(free_velocity)) / (2.0 * half_mobility)
    taken = p.edge * free_velocity
    if free_velocity > 0.0:
        return -given, given + taken
    return taken - given, given


def planned_bounds(
    p: AccountParams,
    funds: float,
    free_velocity: float,
    smooth: float,
    half_mobility: float,
    period: float,
) -> tuple[float, float]:
    """Return between which efforts the law may choose [N m or N], held forces kept.

    All funds [J] allow what they do at the velocity of the coming period, and a tenth of them what
    it does at the smoothed one. Other arguments are those of `gate_bounds`.
    """
    may = p.share * funds
    low, high = gate_bounds(p, may, free_velocity, half_mobility, period)
    calm_low, calm_high = gate_bounds(p, CALM_SHARE * may, smooth, half_mobility, period)
    if calm_low > low:
        low = calm_low
    if calm_high < high:
        high = calm_high
    return low, high


def is_covered(
    p: AccountParams,
    funds: float,
    effort: float,
    free_velocity: float,
    smooth: float,
    half_mobility: float,
    period: float,
) -> bool:
    """Return whether an effort [N m or N] is surely within `planned_bounds`: cheaper than these.

    The parabolas of `gate_bounds` themselves, without root or division: most efforts are within.
    With u = |v| + 2 M |R|, `u**2 < v**2 + 4 M funds / T` says |R| < g. `SURELY` exceeds all that
    rounding does to either side, so a bound that is computed does not bind either. Arguments are
    those of `planned_bounds`.
    """
    may = 4.0 * half_mobility * p.share * funds
    reach = 2.0 * half_mobility * math.fabs(effort)
    fast = math.fabs(free_velocity) + reach
    calm = math.fabs(smooth) + reach
    if not (SURELY * fast * fast - free_velocity * free_velocity) * period < may:
        return False
    return (SURELY * calm * calm - smooth * smooth) * period < CALM_SHARE * may


def lets_go(p: AccountParams, asked: float, passed: float) -> bool:
    """Return whether an end lets go of what its law presses with.

    `asked` and `passed` [N m or N]: sums over a window of the sizes of what the law asked for, no
    more than the limit, and of what the account let through. A full account lets all of it through,
    an empty one nothing that may give.
    """
    return asked > p.window * p.felt and passed < HELD_SHARE * asked


def is_apart(p: AccountParams, asked: float, passed: float) -> bool:
    """Return whether an end cuts so much of a steady effort that its pair stands apart for it.

    `asked` and `passed` [N m or N]: sums over a window as in `lets_go`, but with their signs, so
    that what a swing is cut by counts as far as it leaves something over.
    """
    cut = math.fabs(asked - passed)
    wanted = math.fabs(asked)
    return cut > p.window * p.felt and cut > (1.0 - APART_SHARE) * wanted


def level_missing(far_level: float) -> float:
    """Return the share of the far tank that is empty, 0 to 1."""
    missing = 1.0 - far_level
    if missing <= 0.0:
        return 0.0
    if missing > 1.0:
        return 1.0
    return missing


def level_friction(p: AccountParams, velocity: float) -> float:
    """Return what a leader resists with while the far tank is empty [N m or N], noise aside.

    A follower's friction takes power at any speed, a damper at the leader little at a low one. On a
    smoothed velocity noise makes so little of it that nothing is granted for it.
    """
    share = velocity / p.slip
    if share > 1.0:
        share = 1.0
    elif share < -1.0:
        share = -1.0
    return p.friction * share + p.drag * velocity


def close_account(p: AccountParams, funds: float, income: float) -> tuple[float, float]:
    """Book an income [J]; return funds and what is spilled from a full account [J]."""
    funds = funds + income
    spilled = 0.0
    if funds > p.capacity:
        spilled = funds - p.capacity
        funds = p.capacity
    return funds, spilled


def credit_due(p: AccountParams, funds: float, far_level: float) -> float:
    """Return the credit [J] that an end sends now, to a tank of that level [1]."""
    spare = funds - p.mark + (p.mark - p.least) * level_missing(far_level / p.enough)
    if spare > 0.0:
        return SENT_SHARE * spare
    return 0.0


def credit_received(counter: float, known: float) -> float:
    """Return what a counter [J] adds to what is known of it: nothing if it is an older one."""
    if counter > known:
        return counter - known
    return 0.0


def brake_effort(p: AccountParams, funds: float, effort: float) -> float:
    """Return what may act of a stop's damping [N m or N]: nothing of an overdrawn account."""
    if funds >= -p.debt:
        return effort
    return 0.0
