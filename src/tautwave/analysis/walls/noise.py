"""Power that a passive wall generates from encoder noise, indefinitely: a bound in watts.

A sample that is off by n has the wall's effort off by e = h * n, h the wall's impulse response, of
size L = sum |h_j| <= K + 2 g |B| / T; one that is cut off at the wall's edge is off by less. The
rest, device, wall without noise and hand, is passive. Two bounds hold at once:

*By inertia.* Let that rest be linear, in contact, the mean of e_k e_(k+j) be r_j, and m the least
inertia. The part of the motion that answers to e_k begins at rest. What it gave the inertia it had
from e_k: within the period m v^2 / 2 <= e_k x, so x <= e_k T^2 / (2 m) at its end; later nothing
passive makes it faster than e_k T / m, so it goes no further than e_k T^2 / m a period. The mean of
e dx in a period is so at most T^2 / m (r_0 / 2 + sum over j >= 1 of |r_j|). The sum of |r_j| over
all j is at most L^2 times that of the noise, so the power is at most

    T / (2 m) L^2 sigma^2 (1 + 2 sum |rho_j|),

which for white noise on a spring is what it gives a free device: (K sigma)^2 T / (2 m).

*By damping.* What the device has beyond the wall's need, d, takes d dx^2 / T in each period, and
|e dx| - d dx^2 / T <= T e^2 / (4 d): the power is at most L^2 sigma^2 / (4 d), whatever the hand.

Source: derived here.
"""

from __future__ import annotations

import math

from tautwave.analysis.walls.sampled import SampledWall, velocity_gain
from tautwave.models.noise_colour import LAGS


def wall_noise_power(
    wall: SampledWall,
    inertia: float,
    surplus: float,
    deviation: float,
    autocorrelation: tuple[float, ...] | None = None,
) -> float:
    """Return the most that noise has a passive wall give on average [W].

    Parameters
    ----------
    wall : SampledWall
        The wall.
    inertia : float
        Least inertia of the device [kg or kg m^2].
    surplus : float
        Its damping less what the wall needs [N s/m or N m s/rad].
    deviation : float
        Standard deviation of the noise [m or rad].
    autocorrelation : tuple of float, optional
        rho_1, rho_2, ... per variance [1]; without it that of any noise with `LAGS` lags.
    """
    size = wall.stiffness + 2.0 * velocity_gain(wall) * abs(wall.damping) / wall.period
    lags = float(LAGS) if autocorrelation is None else sum(map(abs, autocorrelation))
    variance = (size * deviation) ** 2
    by_inertia = 0.5 * wall.period / inertia * variance * (1.0 + 2.0 * lags)
    by_damping = variance / (4.0 * surplus) if surplus > 0.0 else math.inf
    return min(by_inertia, by_damping)
