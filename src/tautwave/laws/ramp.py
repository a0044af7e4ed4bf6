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
is stopped as overdrawn or as a lost coupling. Source: derived here.
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
