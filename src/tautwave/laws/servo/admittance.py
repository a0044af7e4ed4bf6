"""The sampled wave port of an admittance device (takes velocity, measures effort).

The port commands the velocity w at which the line's resistance b w - sqrt(2b) v_in equals the
measured external effort. That effort is one sample old: against an external stiffness K the loop x+
= x + T (-K x + ...) / b is unstable from K T / b = 2 on even with a matched far end, and it is
active (|S| > 1) for every K > 0. With an upper bound Kh >= K of the external stiffness the port
predicts the effort in the middle of the acting period, F - Kh T (w under way + w / 2). For a
command delay of d periods, with q = 1/z and c = cot(theta/2), the port's divisor is D = b + e - j c
Kh T / 2 - (Kh - K) T q**(d+1) / (1 - q), and S = 2 b / D - 1, so |S| <= 1 if Re D >= b.
Re(-q**(d+1) / (1 - q)) = 1/2 + sum_1^d cos(i theta) >= 1/2 - d, hence the extra damping e = Kh T
max(0, d - 1/2) makes the port passive for any external stiffness up to Kh. Nothing is claimed
beyond it, and nothing at all without Kh. An external *damper* B is not covered: its effort is also
one sample old, and with B of the order of b the loop is active, then unstable. The device is
assumed to reach the commanded velocity within the period.

The books of a period are those of `laws.port.port_close`: the mean of two sampled efforts times the
measured displacement enters the tank, the wave of that displacement is paid from it. With D the
plain divisor b, a period changes the tank by T v (F[k] - F[k-1]): the effort's change while the
command was under way. Over a swing of velocity that sums up to a share of b T v**2 per period of
age, which is the reserve E0 = b T (1 + d) v_max**2. Below -E0 the run stops.

Energy: the way is known, dx = w T, the effort only at its ends. The books take the trapezoid, (F[k]
+ F[k+1]) dx / 2, and the true work is the integral of F w. With w constant both are equal where F
is linear in x, so for every outside spring, whatever its stiffness. In general a chord is off by
its curvature: at most |dx| (s T) / 4 for an effort that changes by no more than s per second, and
unbounded for a blow between two samples. So nothing like the claim of an impedance port is sure
here: that one knows F, held by itself, and measures dx; this one would have to know the hand. A
tank over the books claims 2 E0 + W + P t, W = (1 + n) F_max v_max T, of what sensor and encoder
see; what is true besides is s T / 4 of the way covered, and s is the hand's. Verdicts say so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.port import PortParams, port_params


class AdmittanceParams(NamedTuple):
    """Constants of one admittance port, in the device's own units.

    period T [s]; impedance b; root = sqrt(2 b); stiffness = upper bound of the external stiffness
    (0: none given); divisor = b + Kh T / 2 + Kh T max(0, d - 1/2). The wall's constants are in
    `wall.WallParams`; the books and the leaving wave are `port.port_close`, see `rigid_port`.
    """

    period: float
    impedance: float
    root: float
    stiffness: float
    divisor: float


def admittance_params(
    period: float,
    impedance: float,
    stiffness: float,
    delay_periods: int,
    extra: float = 0.0,
) -> AdmittanceParams:
    """Return the constants of an admittance port; units as in `AdmittanceParams`.

    `extra` is damping beyond that of the delay, such as `laws.servo.follower.lag_damping`.
    """
    if delay_periods > 0:
        extra += stiffness * period * (delay_periods - 0.5)
    divisor = impedance + 0.5 * stiffness * period + extra
    return AdmittanceParams(period, impedance, math.sqrt(2.0 * impedance), stiffness, divisor)


def greatest_stiffness(period: float, impedance: float, delay_periods: int) -> float:
    """Return the external stiffness [N m/rad or N/m] at which the plain port loses stability.

    Far end matched, no effort prediction: z**d (z - 1) + K T / b = 0 reaches the unit circle at
    K T / b = 2 sin(pi / (2 (2 d + 1))).
    """
    return 2.0 * impedance / period * math.sin(0.5 * math.pi / (2.0 * delay_periods + 1.0))


def admittance_velocity(
    p: AdmittanceParams,
    effort: float,
    arriving: float,
    pending: float,
    wall_push: float,
    wall_stiffness: float,
    wall_damping: float,
) -> float:
    """Return the velocity to command [rad/s or m/s].

    Parameters
    ----------
    p : AdmittanceParams
        Constants.
    effort : float
        Measured external effort, positive along x [N m or N].
    arriving : float
        Arriving wave [W**0.5].
    pending : float
        Sum of the commanded velocities that have not acted yet [rad/s or m/s].
    wall_push : float
        Resisting effort of the local wall's spring at the start of the acting period [N m or N].
    wall_stiffness, wall_damping : float
        The wall's K and B while touched, else 0; its spring is taken at mid period, implicitly.
    """
    drive = effort - p.stiffness * p.period * pending + p.root * arriving - wall_push
    return drive / (p.divisor + wall_damping + 0.5 * wall_stiffness * p.period)


def rigid_port(
    period: float, impedance: float, *, filter_gain: float, reserve: float, leak: float
) -> PortParams:
    """Return the constants with which `port_close` closes an admittance port; nothing is predicted.

    Arguments are those of `laws.port.port_params`.
    """
    return port_params(
        period, impedance, math.inf, filter_gain=filter_gain, reserve=reserve, leak=leak
    )


def effort_leak(period: float, impedance: float, position: float, effort: float) -> float:
    """Return what errors of the samples send away in waves [W], whatever their colour.

    An error of the effort moves the drive by error / b and leaves as a wave of twice that energy;
    one of the position changes sign from sample to sample at worst.

    Parameters
    ----------
    period, impedance : float
        T [s] and b of the port.
    position, effort : float
        What a sample may be off [rad or m], [N m or N].
    """
    moved = 2.0 * position / period
    return impedance * moved * moved + effort * effort / impedance
