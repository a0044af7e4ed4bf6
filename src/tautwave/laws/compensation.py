"""Friction and inertia of a device, compensated by its own motor.

**Friction**, within what the device is sure to have. A held effort f gives -f dx a period. The
device's Coulomb friction c takes c |path| >= c |dx|: with |f| <= c the two together take energy in
every period, whatever sign, delay, noise or rate the effort has. A viscous effort b' H v of a
velocity read through any |H| <= 1, however late, gives at most b' v**2, and the device's own
damping b >= b' takes that. So both are passive with their device as far as c and b are lower
bounds, and are spent: no wall or port may count on them again.

**Inertia**, out of an energy account. All that accelerates a device but this effort is observed, w,
and answered in the same sense:

    R = -g m w,  g = m_c / (m - m_c),  so that  R = -m_c dv/dt  as long as the observer follows:

with w = dv/dt + R / m the m drops out, whatever the true inertia is. The observer is slower than
the motion: R comes late by some time t, and feeds a swing of frequency f and velocity v with m_c t
(2 pi f v)**2 / 2 watts. No damping that a device has makes that passive at all frequencies (a
first-order lag at f_c asks for 2 pi f_c m_c; a difference of samples for 9/8 m_c / T), so this
effort has an account of its own: what it may give is planned (`laws.account.gate_bounds`), what it
gave is known. The account starts with what the compensated part holds at the velocity limit,
gets back what braking takes, and, of guaranteed Coulomb friction that nobody else counts on, c
|dy|. Here y is the play operator's answer to the samples: of all motions within h of them y has the
shortest path, so the true one, if no sample is off by more, is no shorter, and noise earns nothing.

The newest sample enters R with -G and the next displacement with -1: noise s feigns an income of G
s**2 a period, which is charged. An account below -D lets nothing act until it has been paid, so
with W that commands under way can give, without any noise or delay in the bound,

    given <= E0 + D + W + c |path|.

Sources: Morrison 1969 (the observer, see `laws.observer`); Colgate & Schenkel 1997 (what a lag asks
for); Krasnosel'skii & Pokrovskii 1989 (the play operator). All laws and bounds are derived here.
"""

from __future__ import annotations

from typing import NamedTuple

from tautwave.laws.account import AccountParams, brake_effort, gate_bounds
from tautwave.laws.limit import clamp
from tautwave.laws.observer import ObserverParams, observer_params


class CompensationParams(NamedTuple):
    """What is taken off: coulomb [N m or N], from `soft` [rad/s or m/s] on in full; viscous."""

    coulomb: float
    viscous: float
    soft: float


NO_COMPENSATION = CompensationParams(0.0, 0.0, 1.0)


def compensation_effort(p: CompensationParams, velocity: float) -> float:
    """Return the resisting effort [N m or N] at a velocity [rad/s or m/s]: it helps, so -."""
    return -(p.coulomb * clamp(velocity / p.soft, 1.0) + p.viscous * velocity)


class InertiaParams(NamedTuple):
    """Constants of a device's inertia compensation.

    gain g m [kg m**2 or kg]; most: greatest effort [N m or N]; coulomb [N m or N] that pays;
    play h [rad or m]. Of the account `reserve` is E0, `debt` D, `income` what noise is charged.
    """

    observer: ObserverParams
    gain: float
    most: float
    coulomb: float
    play: float
    account: AccountParams


NO_INERTIA = InertiaParams(
    observer_params(1.0, 1.0, 0.0), 0.0, 0.0, 0.0, 0.0, AccountParams(*(0.0,) * 10)
)


def inertia_gain(mass: float, taken: float) -> float:
    """Return g m [kg m**2 or kg] with which `taken` of an observer's `mass` is taken off."""
    return taken * mass / (mass - taken)


def inertia_effort(
    p: InertiaParams,
    funds: float,
    push: float,
    free_velocity: float,
    half_mobility: float,
    period: float,
    ceiling: float,
) -> float:
    """Return the resisting effort [N m or N]: against the acceleration, so it helps.

    Parameters
    ----------
    p : InertiaParams
        Constants.
    funds : float
        What is in the account [J].
    push : float
        Observed acceleration by all but this effort [rad/s**2 or m/s**2].
    free_velocity : float
        Mean velocity of the coming period without it [rad/s or m/s].
    half_mobility, period : float
        M = T / (2 m), m the lower bound [rad/(s N m) or m/(s N)], and T [s].
    ceiling : float
        Present effort ceiling of the engage ramp [N m or N].
    """
    bound = p.most
    if ceiling < bound:
        bound = ceiling
    wanted = clamp(-p.gain * push, bound)
    low, high = gate_bounds(
        p.account, p.account.share * funds, free_velocity, half_mobility, period
    )
    if wanted < low:
        wanted = low
    elif wanted > high:
        wanted = high
    return brake_effort(p.account, funds, wanted)


def follow_play(play: float, position: float, half_width: float) -> float:
    """Return the play operator's answer to a sample: moved only as far as it has to be [rad, m]."""
    if play < position - half_width:
        return position - half_width
    if play > position + half_width:
        return position + half_width
    return play
