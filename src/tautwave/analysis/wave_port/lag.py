"""What the lag of an observer takes from a port's tank while a lever is moved, in watts.

An observer follows a constant acceleration from outside exactly and lags behind one that ramps: a
hand that swings a lever, a spring that is moved. Its port then resists with b times a velocity that
is off by kappa T**2 times the ramp, and the tank pays that error times the velocity: power that the
device's damping makes good, which the tank does not see. With lever velocity V and effort F of any
phases at one frequency the tank's mean power is

    1/2 (vv |V|**2 + 2 Re(vf conj(V) F) + ff |F|**2),

known from the port alone, whatever stands on both sides. At low frequencies w, vf grows as w and
vv and ff as w**2: swings within limits of velocity and effort take most at a few Hz, and not more
than a bound. `lag_power` is that bound for swings of `SHARE` of both limits. The leak gives it
back, or a tank without declared noise runs dry in use.

Sources: derived here.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.wave_port.sensor_noise import observer_response
from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams

SHARE = 0.25
"""Of velocity and effort limit: amplitudes of the swings that a tank has to bear indefinitely."""

FASTEST_HZ = 10.0
SAMPLES = 50.0
"""Fastest swing, and the least samples in one: faster ones are noise or end soon."""

POINTS = 64
SLOWEST = 1e-3
"""Of the fastest swing."""


class SwingPower(NamedTuple):
    """The tank's mean power as a form of velocity and effort amplitudes, each of shape (n,)."""

    vv: npt.NDArray[np.float64]
    vf: npt.NDArray[np.complex128]
    ff: npt.NDArray[np.float64]


def swing_power(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    theta: npt.NDArray[np.float64],
) -> SwingPower:
    """Return the form at e^(j theta); velocity is the mean of the period in which F acts."""
    ahead = np.exp(1j * theta)
    by_sample, by_effort = observer_response(observer, theta)
    lead = p.period * p.lead
    under_way = sum((ahead**at for at in range(delay_periods)), np.zeros_like(ahead))
    # own F = b seen x - root a, solved for a; x of a unit of velocity
    x = p.period / (ahead - 1.0)
    fed = by_effort[1] + lead * by_effort[2]
    own = ahead**delay_periods * p.divisor + p.impedance * (2.0 * p.half_mobility * under_way - fed)
    seen = by_sample[1] + lead * by_sample[2]
    arriving = np.array([p.impedance * seen * x, -own]) / p.root
    rate = p.root * (1.0 - 1.0 / ahead) / p.period
    low_pass = p.filter_gain / (1.0 - (1.0 - p.filter_gain) / ahead)
    plain = np.array([rate * by_sample[0] * x, rate * by_effort[0] - p.root * p.slip / ahead])
    leaving = low_pass * (plain - ahead ** -(delay_periods + 1.0) * arriving)
    size = 0.5 * (np.abs(arriving) ** 2 - np.abs(leaving) ** 2)
    cross = 0.5 * (np.conj(arriving[0]) * arriving[1] - np.conj(leaving[0]) * leaving[1])
    return SwingPower(size[0], cross + 0.5, size[1] - p.slip)


@functools.lru_cache(maxsize=256)
def lag_power(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    effort_limit: float,
    velocity_limit: float,
) -> float:
    """Return the most that swings of `SHARE` of both limits take from a tank [W].

    A port without an observer pays a share of all work instead (`laws.port.plain_drain`), which no
    leak can carry: 0 for it, and where there are no limits.

    Parameters
    ----------
    p, observer : PortParams, ObserverParams
        The port; its own leak is not used.
    delay_periods : int
        Command delay; a fraction counts as a whole period.
    effort_limit, velocity_limit : float
        Of the axis [N m, rad/s or N, m/s].
    """
    if observer.pole < 0.0 or math.isinf(effort_limit) or math.isinf(velocity_limit):
        return 0.0
    fastest = 2.0 * math.pi * min(FASTEST_HZ * p.period, 1.0 / SAMPLES)
    swing = swing_power(
        p, observer, delay_periods, np.geomspace(SLOWEST * fastest, fastest, POINTS)
    )
    effort, velocity = SHARE * effort_limit, SHARE * velocity_limit
    gained = swing.vv * velocity**2 + swing.ff * effort**2
    power = 0.5 * (gained - 2.0 * np.abs(swing.vf) * velocity * effort)
    return max(-float(power.min()), 0.0)
