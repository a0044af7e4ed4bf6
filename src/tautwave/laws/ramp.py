"""How much effort may be built up where `effort_rate_limit` can take it away only slowly.

From the next command on, an effort F that falls by R T per period has the impulse
I = (F - R T) F / 2R. It turns a device of mass m that nothing else moves from a velocity u against
the effort to u - I/m, and gives out (I - m u)**2 / 2m once it is turned, or, where the device moves
with the effort (u < 0) from the start, I |u| + I**2 / 2m. With A [J] to spend

    I <= m (u + sqrt(2A/m + min(u, 0)**2)),   so   F = h + sqrt(h**2 + 2 R m (u + ...))

with h = R T / 2. R T is always free, and without a rate limit there is no bound. With nothing to
spend this is the parabola on which a double integrator is stopped in the shortest time. What a
command delay adds, n T F, is counted with the commands under way (`analysis.claim`).

Without the bound an effort that lags swings its device, and the swing empties the tank: the port
is stopped as overdrawn or as a lost coupling.

A host that stalls for h seconds holds its last effort before the ramp begins: I = F h + F**2 / 2R.
So that a device that nothing else moves gains no more than E in the stall, which it enters with the
velocity w along the effort,

    I <= m g,  g = sqrt(2E/m + w**2) - w,   so   F = 2 m g / (h + sqrt(h**2 + 2 m g / R))

(`stall_bound`). A device that moves against the effort may be stopped by what is outside, after
which it gains as much as one at rest: w is 0 then. The velocity is as good as its samples: an error
of d costs I d, so d is added to w. Source: derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.limit import clamp


class RampParams(NamedTuple):
    """Constants, in the device's own units.

    half_step h: half of what the effort may change in a period [N m or N], 1e308 without
    a limit, since constants are finite; gain 2 R m; spread 2/m, the squared velocity per energy.
    """

    half_step: float
    gain: float
    spread: float


NO_RAMP = RampParams(1e308, 0.0, 0.0)


def ramp_params(period: float, mass: float, rate: float) -> RampParams:
    """Return the constants.

    Parameters
    ----------
    period : float
        T [s].
    mass : float
        Lower bound of the inertia [kg m**2 or kg].
    rate : float
        R, how fast the effort may change [N m/s or N/s]; inf: at once.
    """
    if math.isinf(rate):
        return NO_RAMP
    return RampParams(0.5 * rate * period, 2.0 * rate * mass, 2.0 / mass)


def ramp_bound(p: RampParams, energy: float, against: float) -> float:
    """Return the greatest effort that `energy` pays for until it is taken away [N m or N].

    Parameters
    ----------
    p : RampParams
        Constants.
    energy : float
        What may be given out [J].
    against : float
        Velocity against the effort where it acts [rad/s or m/s].
    """
    free = 0.0
    if energy > 0.0:
        free = p.spread * energy
    if against < 0.0:
        free = free + against * against
    speed = against + math.sqrt(free)
    if not speed > 0.0:
        speed = 0.0
    return p.half_step + math.sqrt(p.half_step * p.half_step + p.gain * speed)


def ramped_effort(p: RampParams, energy: float, velocity: float, effort: float) -> float:
    """Return as much of a resisting effort [N m or N] as `energy` pays for; see `ramp_bound`.

    One that is not finite comes back as it is, for the guard of the loop to find.
    """
    if effort - effort != 0.0:
        return effort
    against = velocity
    if effort < 0.0:
        against = -velocity
    return clamp(effort, ramp_bound(p, energy, against))


class StallParams(NamedTuple):
    """Constants of the effort bound of a host that stalls, in the device's own units.

    hold h [s]; double_mass 2 m; fall 2 m / R, 0 without a rate limit; free 2 E / m, the squared
    velocity that a device at rest may gain; doubt: error of the velocity [rad/s or m/s]; kept: what
    acts beside the bounded effort, for a load [N m or N].
    """

    hold: float
    double_mass: float
    fall: float
    free: float
    doubt: float
    kept: float


NO_STALL = StallParams(1.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def stall_params(
    hold: float, mass: float, rate: float, energy: float, doubt: float = 0.0, kept: float = 0.0
) -> StallParams:
    """Return the constants.

    Parameters
    ----------
    hold : float
        h, for how long an effort may be held unseen, > 0 [s].
    mass : float
        Lower bound of the inertia [kg m**2 or kg].
    rate : float
        R, how fast the effort may change [N m/s or N/s]; inf: at once.
    energy : float
        E, what a device let go may gain meanwhile [J].
    doubt : float
        Error of the velocity [rad/s or m/s].
    kept : float
        Effort that acts beside the bounded one [N m or N].
    """
    fall = 0.0 if math.isinf(rate) else 2.0 * mass / rate
    return StallParams(hold, 2.0 * mass, fall, 2.0 * energy / mass, doubt, kept)


def stall_bound(p: StallParams, along: float) -> float:
    """Return the greatest effort that may be held through a stall [N m or N].

    Parameters
    ----------
    p : StallParams
        Constants.
    along : float
        Velocity of the device along the effort, where that begins to act [rad/s or m/s].
    """
    speed = p.doubt
    if along > 0.0:
        speed = speed + along
    root = math.sqrt(p.free + speed * speed)
    gain = 0.0
    if root > 0.0:
        gain = p.free / (root + speed)
    bound = p.double_mass * gain / (p.hold + math.sqrt(p.hold * p.hold + p.fall * gain)) - p.kept
    if not bound > 0.0:
        return 0.0
    return bound


def stall_ceiling(
    p: StallParams, velocity: float, free_velocity: float, effort: float, ceiling: float
) -> float:
    """Return the lower of `ceiling` and what a stall allows of a resisting effort [N m or N].

    A device has the velocity with which it enters the period of the command from what it had, by
    efforts that are known and a mass of which only the lower bound is: that of a heavier one lies
    between `velocity` and `free_velocity`.

    Parameters
    ----------
    p : StallParams
        Constants.
    velocity : float
        Mean velocity measured between the last two samples [rad/s or m/s].
    free_velocity : float
        Velocity with which the lightest device enters the period [rad/s or m/s].
    effort : float
        Resisting effort [N m or N].
    ceiling : float
        Its bound by other reasons [N m or N].
    """
    along = free_velocity
    if (velocity > free_velocity) == (effort < 0.0):
        along = velocity
    if effort > 0.0:
        along = -along
    bound = stall_bound(p, along)
    if bound < ceiling:
        return bound
    return ceiling
