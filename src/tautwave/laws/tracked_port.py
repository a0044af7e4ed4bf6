"""The sampled wave port of an impedance device (takes effort): passive in practice too.

The obvious port estimates the velocity, applies R = b v - sqrt(2b) v_in and sends
u = sqrt(2b) v - v_in. Its books close on paper, because they multiply a force by a velocity of
another period; on a real device it is unstable against a lossless far end at every delay. This
port does three things instead:

1. it predicts the mean velocity of the period in which the effort *will act*, with a lower bound
   of the device's mass and every effort that is known or still under way;
2. the leaving wave is formed from the displacement over the period in which the effort acted;
3. an energy account stands between what came in and what leaves; a wave is never larger than the
   account can pay, and an effort is never planned to deliver what is not there. A port that owes
   more than prediction errors can cause (`port_debt`) lets go until the debt is repaid.

Proof of 1 and 2 for a free mass m, a believed mass m/rho with rho >= 1, and a command delay of d
whole periods. Let q = 1/z, a = b T / (2 m), c = cot(theta/2); the held force gives the mean
velocity V = j (T/2m) c R (resistance R acting). Solving the port for wave in -> wave out gives
S = -(D + 2 j a c) / D with D = 1 - j a c + (rho - 1) a g(q), g(q) = (1+q)(1 + q + ... + q**d)
= -j c (1 - q**(d+1)). Im g = -c (1 - cos((d+1) theta)) <= 0, hence
|D|**2 - |D + 2 j a c|**2 = 4 a**2 c**2 (rho - 1)(1 - cos((d+1) theta)) >= 0: |S| <= 1 at every
frequency. Im D < 0 on the open upper half of the circle, from -j infinity at q = 1 to 1 at
q = -1, so D has no zero inside and S is stable. A passive far end behind any delay then keeps
the loop stable. With an underestimated mass the port loses energy, with an overestimated one
it would gain.

Sources: Niemeyer & Slotine 1991, Colgate & Schenkel 1997 (what a held force does), Chopra & Spong
and Hannaford & Ryu 2002 (energy accounts); the delayed form is derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

BANKRUPT = -1.0e300
"""Account value [J] of a port that owes more than prediction errors can cause."""


ROUNDING = 1.0e-9
"""Share of an arriving wave's energy that an account may be off by rounding."""


class PortParams(NamedTuple):
    """Constants of one impedance port, in the device's own units.

    period T [s]; impedance b; root = sqrt(2 b); half_mobility = T / (2 mass lower bound);
    divisor = 1 + b half_mobility + b slip; slip = 1 / series damper, 0 without, 1/b to match the
    line; repay: share of the unsent wave integral that is sent per period; allowance: energy
    [J per period] of apparent loss by sensor noise, see `sensor_allowance`.
    """

    period: float
    impedance: float
    root: float
    half_mobility: float
    divisor: float
    slip: float
    repay: float
    allowance: float


def port_params(
    period: float,
    impedance: float,
    mass: float,
    matched: bool,
    drift_time: float,
    allowance: float,
) -> PortParams:
    """Return the constants of a port.

    Parameters
    ----------
    period : float
        Loop period T [s].
    impedance : float
        Wave impedance b [N m s/rad or N s/m].
    mass : float
        Lower bound of the device's inertia [kg m**2 or kg].
    matched : bool
        True puts a damper b in series, so that no wave is reflected (and positions may creep).
    drift_time : float
        Time constant in which unsent wave integral (position error) is repaid [s].
    allowance : float
        Energy granted per period [J], see `sensor_allowance`.
    """
    mobility = period / (2.0 * mass)
    slip = 0.0
    if matched:
        slip = 1.0 / impedance
    repay = period / (period + drift_time)
    divisor = 1.0 + impedance * mobility + impedance * slip
    root = math.sqrt(2.0 * impedance)
    return PortParams(period, impedance, root, mobility, divisor, slip, repay, allowance)


def rigid_port(period: float, impedance: float, drift_time: float, allowance: float) -> PortParams:
    """Return the constants with which `port_close` closes an admittance port (no prediction)."""
    repay = period / (period + drift_time)
    root = math.sqrt(2.0 * impedance)
    return PortParams(period, impedance, root, 0.0, 1.0, 0.0, repay, allowance)


def sensor_allowance(
    period: float, impedance: float, gain: float, quantum: float, noise: float
) -> float:
    """Return the apparent energy loss per period [J] that an encoder causes at a port.

    A position error n of the last sample enters the effort as b g n / T and the next displacement
    as -n: measured energy falls by b g n**2 / T each period although no physical energy left the
    port. Without an allowance the account would run dry and the coupling go dead. `gain` is that of
    `track_velocity`; `quantum` and `noise` (standard deviation) are in rad or m; twice the mean is
    allowed.
    """
    return 2.0 * impedance * gain * (noise * noise + 0.25 * quantum * quantum) / period


def port_debt(p: PortParams, delay_periods: int, gain: float, fastest: float, flow: float) -> float:
    """Return the account's greatest temporary debt [J], besides the allowance.

    The account is exact after each period, but an effort is planned on a predicted velocity. Its
    error e costs b T e v; it is a change of velocity, of which b T (1 + d) v**2 can come together,
    or an effort balanced by an external force, which adds b T (1 + d) / m of that effort's work. A
    port that owes more lets go in the next period: the energy it delivers in the 1 + d periods
    until that acts comes on top.

    Parameters
    ----------
    p : PortParams
        Constants.
    delay_periods : int
        Command delay d, a remainder counted as one.
    gain : float
        Of the velocity tracker, 1 without a filter: with it the prediction is old by 1/gain periods
        and not one.
    fastest : float
        Greatest measured mean velocity of a period [rad/s or m/s].
    flow : float
        Sum of |effort * displacement| of the axis, port and wall together [J].
    """
    share = p.impedance * (1.0 / gain + delay_periods)
    return share * (p.period * fastest * fastest + 2.0 * p.half_mobility * flow)


def track_velocity(gain: float, predicted: float, displacement: float, span: float) -> float:
    """Correct a predicted mean velocity by the measured one: gain 1 is the plain difference."""
    return predicted + gain * (displacement / span - predicted)


def port_effort(
    p: PortParams, account: float, coast: float, arriving: float
) -> tuple[float, float]:
    """Return the resisting effort of the port and the predicted mean velocity of its period.

    Parameters
    ----------
    p : PortParams
        Constants.
    account : float
        Energy account after the last close [J]; `BANKRUPT` when it owes more than `port_debt`: then
        the device does not follow any prediction, and the port lets go.
    coast : float
        Mean velocity of the coming acting period if the port did nothing [rad/s or m/s].
    arriving : float
        Arriving wave [W**0.5].

    Returns
    -------
    tuple of float
        Resisting effort [N m or N] and predicted mean velocity [rad/s or m/s].
    """
    if account <= BANKRUPT:
        return 0.0, coast
    effort = (p.impedance * coast - p.root * arriving) / p.divisor
    ahead = coast - p.half_mobility * effort
    given = -effort * (ahead - p.slip * effort) * p.period
    if given > 0.0:
        funds = account + 0.5 * p.period * arriving * arriving
        if given > funds:
            # Only after clipping, gaps or sensor noise: an unclipped port never plans this.
            if funds > 0.0:
                effort = effort * (funds / given)
            else:
                effort = 0.0
            ahead = coast - p.half_mobility * effort
    return effort, ahead


def port_close(
    p: PortParams,
    account: float,
    gap: float,
    displacement: float,
    periods: float,
    velocity: float,
    effort: float,
    wave_sum: float,
    wave_energy: float,
) -> tuple[float, float, float, float, float, float]:
    """Close the periods since the last sample: first the books, then the leaving wave.

    Parameters
    ----------
    p : PortParams
        Constants.
    account : float
        Energy account [J].
    gap : float
        Wave integral not sent yet [W**0.5 s]; sqrt(2b) times a position error.
    displacement : float
        Measured displacement since the last valid sample [rad or m].
    periods : float
        Number of periods since then, >= 1.
    velocity : float
        Tracked mean velocity over them [rad/s or m/s].
    effort : float
        Mean resisting effort of the port that acted [N m or N].
    wave_sum : float
        Sum of the arriving waves that belong to these periods [W**0.5].
    wave_energy : float
        Energy of all waves that arrived since the last close [J].

    Returns
    -------
    tuple of float
        Leaving wave [W**0.5], account [J], gap [W**0.5 s], energy absorbed by the port and by
        the series damper [J], energy forgiven [J].
    """
    period = p.period
    span = periods * period
    slipped = p.slip * effort
    advance = displacement - span * slipped
    income = effort * advance + wave_energy
    dissipated = effort * slipped * span
    account = account + income
    arriving = wave_sum
    if periods != 1.0:
        arriving = wave_sum / periods
    plain = p.root * (velocity - slipped) - arriving
    gap = gap + p.root * advance - period * wave_sum
    leaving = plain + p.repay * (gap / period - plain)
    sent = 0.5 * period * leaving * leaving
    # A wave that is clearly paid for needs no root: the ceiling would not change it.
    if not sent < 0.999 * account:
        if account <= 0.0:
            leaving = 0.0
        else:
            ceiling = math.sqrt(2.0 * account / period)
            if leaving > ceiling:
                leaving = ceiling
            elif leaving < -ceiling:
                leaving = -ceiling
        sent = 0.5 * period * leaving * leaving
    account = account - sent
    gap = gap - period * leaving
    forgiven = 0.0
    if account < 0.0 and p.allowance > 0.0:
        forgiven = periods * p.allowance
        if forgiven > -account:
            forgiven = -account
        account = account + forgiven
    return leaving, account, gap, income - sent, dissipated, forgiven
