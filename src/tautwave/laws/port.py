"""The sampled wave port of an impedance device with an observer, a reserve and a filter inside.

What it does in a period:

1. an observer (`laws.observer`) estimates velocity and outside acceleration; from them, and
   from every effort under way, the port predicts the mean velocity of the period in which its
   effort acts, and resists with R = b v - sqrt(2b) v_in;
2. the leaving wave is sqrt(2b) times the *observed* advance minus the wave that arrived, passes
   the wave filter, is repaid what was cut before, and is paid for from a tank: after the filter,
   exactly what goes on the line;
3. the tank starts with a reserve E0, takes F dx + waves in, with raw samples, and a leak of P watts
   for what sensor noise feigns; it never holds more than the reserve and the filter's energy.

What is true of the energy g that a port supplied, as seen by its encoder, for any device, hand,
delay, noise or mass:

    A = E0 + sum(F dx + e_in - e_out) + P t - spilled,  so  g = E0 - A + P t - spilled.

A wave is sent only out of a positive A, so only a held effort can bring A below zero; the port
stops below -E0, at most n + 1 commands later. Hence g <= 2 E0 + W + P t. With a
sample in each period W = (1 + n) F_max (v_max T + 2 nbar), nbar what one sample may be off; where
samples are missing, W takes the periods without one as well. Nothing in it is measured.

The tank is kept in a stop, whose damping acts only while A >= -E0 (`port_brake`): from there what
is under way brings A to -E0 - W at most, as in the run. So the bound holds to the last command,
however late or noisy the velocity that is damped.

A matched end's damper takes F**2 T / b out of the tank in a period and gives nothing back. In the
last n + 1 periods that lowers A, and raises what the damper has dissipated, by the same: for the
end, port and damper together, it cancels, and W has no such term. In a stop there is no damper.

Credit before the clip, never after: noise has no mean, and a tank clipped at zero turns its dips
into lost waves. Repaying only out of what stands above half the reserve: else a starved port never
recovers. An effort that limits cut pays for its own period: the wave may carry what came in. None
is built up that the tank could not pay for until `effort_rate_limit` is done with it (`laws.ramp`).

An emptied tank recovers by a friction: while an end owes and its tank is low, it resists the motion
of its own device (`recovery_friction`) as a device with more Coulomb friction would. A wave port is
lossless, so the hand that moves the device pays, behind any delay, network or scale, and what is
paid arrives in the tank of the end that owes: nothing is sent for it. The bound above does not
change, since its sum holds for any effort F, and W counts the whole F_max whatever requests it; so
for any two times between which an end runs, too. The friction is planned to take only: it acts
while the smoothed and the predicted velocity have the same sign, and where a prediction errs the
tank pays as for any effort. While nothing moves, nothing is paid: a hand at rest leaves the leak
alone to recover. Nor may noise pass for motion: a friction that follows it takes more out of the
tank than the leak gives, so it begins at the apparent velocity of noise over a period.

The cap of the tank may not be raised meanwhile by what is owed. The whole run would keep its bound,
but in a part of it an end could give out what it had taken before.

Sources: Niemeyer & Slotine 1991 (waves), Chopra & Spong, Franchi and others 2011 (tanks); the
law and its bound are derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.limit import clamp
from tautwave.laws.ramp import RampParams, ramp_params, ramped_effort

RECOVERY_S = 0.01
"""Time over which the velocity is smoothed that friction resists, and its least time constant [s]:
noise beyond what is declared has to be found before a tank that it empties is filled by motion."""

RECOVERY_PERIODS = 4.0
"""The same in periods until a command acts: a friction that lags would push."""

RECOVERY_SLOPE = 3.0
"""Of m over that time: the damping by which friction begins. A damper behind such a lag lets a free
device swing; one that only takes does not."""

REPAID_SHARE = 0.1
"""Of what stands above half the reserve, the share that a period may spend on repaying."""


class RecoveryParams(NamedTuple):
    """Constants of the friction by which an emptied tank recovers, in the device's own units.

    friction [N m or N] at most, 0 for none; slope [N m s/rad or N s/m] below that, from the least
    velocity on [rad/s or m/s]; smoothing of the velocity [1]; share of it per gap [1/(W**0.5 s)];
    need of it per energy below three quarters of the reserve [1/J].
    """

    friction: float
    slope: float
    least: float
    smoothing: float
    share: float
    need: float


NO_RECOVERY = RecoveryParams(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)


class PortParams(NamedTuple):
    """Constants of one port, in the device's own units.

    period T [s]; impedance b; root = sqrt(2 b); half_mobility = T / (2 mass lower bound);
    divisor = 1 + b half_mobility + b slip; coast_gain = b / divisor and wave_gain = root / divisor:
    effort per velocity and per arriving wave; advance_gain = root / T: leaving wave per
    displacement; slip = 1 / series damper, 0 without, 1/b to match the line; lead: periods from a
    sample to the middle of the period in which its command acts;
    filter_gain: step of the wave filter, 1 without; kept [J/W]: what the filter still has to send
    per squared wave; repay: share of the unsent wave integral that is sent per period; reserve E0
    [J]; leak [J per period]; half_period [s] and ahead = lead T [s], as they are used; ramp: how
    fast an effort can be taken away; recovery: the friction while it owes and its tank is low.
    """

    period: float
    impedance: float
    root: float
    half_mobility: float
    divisor: float
    coast_gain: float
    wave_gain: float
    advance_gain: float
    slip: float
    lead: float
    filter_gain: float
    kept: float
    repay: float
    reserve: float
    leak: float
    half_period: float
    ahead: float
    ramp: RampParams
    recovery: RecoveryParams = NO_RECOVERY


def port_params(
    period: float,
    impedance: float,
    mass: float,
    *,
    delay: float = 0.0,
    matched: bool = False,
    filter_gain: float = 1.0,
    drift_time: float = 0.05,
    reserve: float,
    leak: float = 0.0,
    effort_rate: float = math.inf,
) -> PortParams:
    """Return the constants of a port.

    Parameters
    ----------
    period : float
        Period T of the axis [s].
    impedance : float
        Wave impedance b [N m s/rad or N s/m].
    mass : float
        Lower bound of the inertia [kg m**2 or kg].
    delay : float
        Command delay n in periods, with its fraction.
    matched : bool
        True puts a damper b in series, so that no wave is reflected (positions creep).
    filter_gain : float
        Step of the wave filter at this period, `laws.wave_filter.filter_gain`.
    drift_time : float
        Time constant in which cut waves are repaid [s].
    reserve, leak : float
        E0 [J], see `port_reserve`; energy [J] given to the tank each period.
    effort_rate : float
        How fast the effort may change [N m/s or N/s].
    """
    mobility = period / (2.0 * mass)
    root = math.sqrt(2.0 * impedance)
    slip = 0.0
    if matched:
        slip = 1.0 / impedance
    divisor = 1.0 + impedance * mobility + impedance * slip
    return PortParams(
        period,
        impedance,
        root,
        mobility,
        divisor,
        impedance / divisor,
        root / divisor,
        root / period,
        slip,
        delay + 0.5,
        filter_gain,
        0.5 * period * (1.0 - filter_gain) / filter_gain,
        period / (period + drift_time),
        reserve,
        leak,
        0.5 * period,
        period * (delay + 0.5),
        ramp_params(period, mass, effort_rate),
    )


def port_reserve(
    impedance: float, period: float, delay: float, velocity_gain: float, velocity_limit: float
) -> float:
    """Return E0 [J]: what a stop from the velocity limit can cost by wrong predictions.

    b T (1/l + n) v**2, l the observer's correction of velocity per period [1]: an error of v lasts
    1/l periods in the observer and n in what is under way.
    """
    return impedance * period * (1.0 / velocity_gain + delay) * velocity_limit * velocity_limit


def recovery_params(
    period: float,
    mass: float,
    *,
    delay: float,
    friction: float,
    noise: float,
    quantum: float,
    gap: float,
    reserve: float,
) -> RecoveryParams:
    """Return the constants of the friction by which an emptied tank recovers.

    Noise n opens the friction with the newest sample and is -n of the way in which it then acts, so
    it takes up to 0.4 s a period of a friction that is open for half of them: less than the way at
    a velocity s / T, from where the friction begins. An encoder that stands at the edge of a step q
    reads no smoothed velocity beyond q over its time constant.

    Parameters
    ----------
    period, mass : float
        Period T [s] and lower bound of the inertia [kg m**2 or kg].
    delay : float
        Command delay n in periods, with its fraction.
    friction : float
        The most that it may be [N m or N].
    noise, quantum : float
        Deviation s of a sample and encoder step q [rad or m].
    gap : float
        Wave integral from which on it is in full [W**0.5 s].
    reserve : float
        E0 [J].
    """
    time = max(RECOVERY_S, RECOVERY_PERIODS * (1.0 + delay) * period)
    slope = RECOVERY_SLOPE * mass / time
    if noise + quantum > 0.0:  # on that, friction is not in full
        slope = min(slope, 0.5 * friction * time / (noise + quantum))
    least = noise / period + quantum / time
    smoothing = period / (period + time)
    return RecoveryParams(friction, slope, least, smoothing, 1.0 / gap, 4.0 / reserve)


def plain_drain(p: PortParams) -> float:
    """Return the share of the work passing through it that a port without an observer pays for [1].

    It takes the device's last mean velocity and believes in nothing outside. Pushed through at a
    steady velocity v it expects v - (n + 1) T F / m, so that F = b (v - (n + 1) T F / m) - r a, and
    with the leaving wave r v - a its tank changes in a period by

        F v T + T/2 (a**2 - (r v - a)**2) = T v (F - b v + r a) = -(n + 1) b T / m * (F v T).

    That is energy truly passed on: work in one direction empties the tank, work back fills it. The
    outside acceleration of an observer takes the error away, and any pole in [0, 1) has one.
    """
    return 2.0 * p.half_mobility * p.impedance * (p.lead + 0.5)


def port_effort(
    p: PortParams,
    account: float,
    velocity: float,
    outside: float,
    pending: float,
    arriving: float,
) -> float:
    """Return the resisting effort of the port [N m or N].

    Parameters
    ----------
    p : PortParams
        Constants.
    account : float
        Energy in the tank after the last close [J].
    velocity, outside : float
        Observed velocity [rad/s or m/s] and acceleration from outside [rad/s**2 or m/s**2].
    pending : float
        Sum of the resisting efforts [N m or N] that act before this one, each times the periods
        in which it acts; without an observer with half of a local wall's in the same period.
    arriving : float
        Arriving wave [W**0.5].
    """
    free_velocity = velocity + p.ahead * outside - 2.0 * p.half_mobility * pending
    effort = p.coast_gain * free_velocity - p.wave_gain * arriving
    ahead = free_velocity - (p.half_mobility + p.slip) * effort
    given = -effort * ahead * p.period
    funds = account + p.half_period * arriving * arriving
    if not given <= funds and given > 0.0:
        # Absorbing is never taken away; giving is limited to what is there.
        if funds > 0.0:
            return effort * (funds / given)
        return 0.0
    return effort


def port_bounded(
    p: PortParams,
    account: float,
    velocity: float,
    outside: float,
    pending: float,
    effort: float,
) -> float:
    """Return as much of `port_effort` as the tank pays for until it is taken away [N m or N].

    Arguments are those of `port_effort`, and its result. What is taken counts as `cut` in
    `port_close`: else the tank pays for a device that it lets go, and so holds less and less, until
    one end presses with all it has and nothing is felt at the other.
    """
    if effort > p.ramp.half_step or effort < -p.ramp.half_step:
        free_velocity = velocity + p.ahead * outside - 2.0 * p.half_mobility * pending
        return ramped_effort(p.ramp, account, free_velocity, effort)
    return effort


def recovery_friction(
    p: PortParams,
    account: float,
    gap: float,
    smooth: float,
    free_velocity: float,
    effort: float,
) -> float:
    """Return the friction that an end adds while it owes and its tank is low [N m or N].

    In full with a quarter of the reserve less than what a full tank begins to repay from, and gone
    at three quarters: repayment needs half. A matched end takes no more power than it can: the
    effort also moves its series damper, so beyond b v / 2 the tank gets less and less.

    Parameters
    ----------
    p : PortParams
        Constants.
    account, gap : float
        Energy in the tank [J] and wave integral not sent yet [W**0.5 s].
    smooth : float
        Smoothed velocity [rad/s or m/s].
    free_velocity : float
        Mean velocity with which the device would move in the period without port [rad/s or m/s].
    effort : float
        `port_effort` [N m or N].
    """
    k = p.recovery
    need = 3.0 - k.need * account
    ahead = free_velocity - p.half_mobility * effort
    moves = smooth - clamp(smooth, k.least)
    if need <= 0.0 or not moves * ahead > 0.0:
        return 0.0
    share = k.share * math.fabs(gap)
    if share > 1.0:
        share = 1.0
    if need < 1.0:
        share = share * need
    friction = share * clamp(k.slope * moves, k.friction)
    if p.slip != 0.0:
        room = 0.5 * ahead / p.slip - effort
        if room * ahead <= 0.0:
            return 0.0
        friction = clamp(friction, math.fabs(room))
    return friction


def port_brake(p: PortParams, account: float, effort: float) -> float:
    """Return what may act of a stop's damping [N m or N]: nothing of an overdrawn tank.

    Damping on a late or noisy velocity can give. Sent only above the floor of the run, it can bring
    the tank [J] below it by what commands under way give, and no more; NaN is overdrawn.
    """
    if account >= -p.reserve:
        return effort
    return 0.0


def port_close(
    p: PortParams,
    account: float,
    gap: float,
    filtered: float,
    displacement: float,
    advance: float,
    periods: float,
    effort: float,
    wave_sum: float,
    wave_energy: float,
    cut: bool,
) -> tuple[float, float, float, float, float, float, float]:
    """Close the periods since the last sample: the tank first, then the leaving wave.

    Parameters
    ----------
    p : PortParams
        Constants.
    account : float
        Energy in the tank [J].
    gap : float
        Wave integral not sent yet [W**0.5 s]; sqrt(2b) times a position error.
    filtered : float
        The wave filter's state [W**0.5].
    displacement, advance : float
        Measured and observed displacement since the last valid sample [rad or m].
    periods : float
        Periods since then, >= 1.
    effort : float
        Mean resisting effort of the port that acted [N m or N].
    wave_sum, wave_energy : float
        Sum [W**0.5] and energy [J] of the arriving waves whose commands acted.
    cut : bool
        Whether limits or `port_bounded` took from an effort that acted, by more than the drive's
        quantum.

    Returns
    -------
    tuple of float
        Leaving wave [W**0.5], tank [J], gap [W**0.5 s], filter state [W**0.5]; energy absorbed
        from outside and dissipated by the series damper [J], energy spilled from a full tank [J].
    """
    period = p.period
    span = period
    arriving = wave_sum
    leak = p.leak
    if periods != 1.0:
        span = periods * period
        arriving = wave_sum / periods
        leak = periods * leak
    plain = p.advance_gain * advance
    if periods != 1.0:
        plain = plain / periods
    moved = displacement
    dissipated = 0.0
    if p.slip != 0.0:
        slipped = p.slip * effort
        plain = plain - p.root * slipped
        moved = displacement - span * slipped
        dissipated = effort * slipped * span
    income = effort * moved + wave_energy
    account = account + income + leak
    plain = plain - arriving
    filtered = filtered + p.filter_gain * (plain - filtered)
    leaving = filtered
    if gap != 0.0:
        leaving = filtered + repayment(p, account, gap, filtered)
    if cut:
        carried = arriving * arriving + 2.0 * effort * displacement / span
        if carried > 0.0:
            leaving = clamp(leaving, math.sqrt(carried))
        else:
            leaving = 0.0
    sent = p.half_period * leaving * leaving
    if not sent <= account:  # NaN is not
        if account > 0.0:
            leaving = clamp(leaving, math.sqrt(2.0 * account / period))
        else:
            leaving = 0.0
        sent = p.half_period * leaving * leaving
    if leaving != filtered or periods != 1.0:
        # Slots without a sample sent nothing: their share of the integral is kept.
        gap = gap + period * (filtered - leaving) + (periods - 1.0) * period * plain
    account = account - sent
    spilled = 0.0
    full = p.reserve + p.kept * filtered * filtered
    if account > full:
        spilled = account - full
        account = full
    return leaving, account, gap, filtered, income - sent, dissipated, spilled


def port_repeat(
    p: PortParams, account: float, gap: float, filtered: float
) -> tuple[float, float, float]:
    """Repeat the wave of the last sample in a slot without one: (wave, account, gap).

    Paid in full now, and out of a positive account like every wave; the displacement that comes
    with the next sample is for all its slots, so what was sent for them is taken off the gap.
    """
    energy = p.half_period * filtered * filtered
    if not energy <= account:  # NaN is not
        return 0.0, account, gap
    return filtered, account - energy, gap - p.period * filtered


def port_rescale(
    account: float, gap: float, filtered: float, ratio: float
) -> tuple[float, float, float, float]:
    """Take a port over to another scale: (account, gap, filter state, energy lost).

    `ratio` is the device's energy per energy of the pair, the new over the old. Waves and what they
    owe stay as they are on the line, so positions do. The tank [J of the device] grows neither in
    the device's joules, in which the port claims, nor in the pair's, in which the books close:
    account' = account min(1, ratio). What is lost [J, new units] is dissipated.
    """
    root = math.sqrt(ratio)
    kept = account * min(1.0, ratio)
    return kept, root * gap, root * filtered, ratio * account - kept


def repayment(p: PortParams, account: float, gap: float, filtered: float) -> float:
    """Return what is added to the leaving wave for waves that were cut before [W**0.5]."""
    wanted = filtered + p.repay * gap / p.period
    if wanted == filtered:
        return 0.0  # what is left of a gap is below rounding
    spare = REPAID_SHARE * (account - 0.5 * p.reserve)
    if spare <= 0.0:
        return 0.0
    return clamp(wanted, math.sqrt(filtered * filtered + 2.0 * spare / p.period)) - filtered
