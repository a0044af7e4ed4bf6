"""Position, velocity and outside acceleration of a device from its samples: what a port predicts.

A fading-memory filter of second degree: between samples the device moves by its known efforts and
by an acceleration from outside that is taken as constant; each sample corrects the three. All
poles of the error are `pole` (p). Standing under a constant effort the error is zero: the velocity
is not biased by the effort, whatever the mass bound (a first-order tracker believes -F t_f / m).

The energy at a port does not rest on this observer: the books take raw samples. It decides how
close the port comes to its impedance, and with that how much of the waves has to be cut.

Sources: Morrison, Introduction to Sequential Smoothing and Prediction, 1969 (the gains); the
acceleration as a state is Ohnishi's disturbance observer (IEEE/ASME Trans. Mechatronics 1(1), 1996)
in discrete form.

What accelerates a device and is not its motor, less its identified friction, is hand or environment
(a reaction-force observer: Murakami, Yu & Ohnishi, IEEE Trans. Ind. Electronics 40(2), 1993). An
inertia that is 10 % off shows 10 % of m a as a force.
"""

from __future__ import annotations

from typing import NamedTuple

from tautwave.laws.limit import clamp


class ObserverParams(NamedTuple):
    """Constants of an observer.

    period T [s]; inverse_mass 1/m [1/(kg m**2) or 1/kg], m the lower bound of the inertia; pole
    p [1]; position [1], velocity [1/s], disturbance [1/s**2]: corrections per error of a sample;
    half_square = T**2 / 2 [s**2].
    """

    period: float
    inverse_mass: float
    pole: float
    position: float
    velocity: float
    disturbance: float
    half_square: float


def observer_params(period: float, mass: float, pole: float) -> ObserverParams:
    """Return the constants of an observer with a triple pole in [0, 1).

    Parameters
    ----------
    period : float
        Period T of the axis [s].
    mass : float
        Lower bound of the inertia [kg m**2 or kg].
    pole : float
        p: the share of an error that is left after a period [1].
    """
    position, velocity, disturbance = observer_gains(pole, period)
    half = 0.5 * period * period
    return ObserverParams(period, 1.0 / mass, pole, position, velocity, disturbance, half)


def plain_observer(period: float, mass: float) -> ObserverParams:
    """Return the constants that take each sample as it is and estimate no outside effort.

    Mean velocity of the last period plus what the known effort adds: the port without an observer.
    It returns no more of a wave than arrives where every pole does, but pays a share of all work
    that passes (`laws.port.plain_drain`): the last choice. A small disturbance gain beside it is no
    way out, for an outside acceleration that lags returns more of a slow wave than arrives; a pole
    near 0 is.
    """
    half = 0.5 * period * period
    return ObserverParams(period, 1.0 / mass, -1.0, 1.0, 1.0 / period, 0.0, half)


def observer_gains(pole: float, span: float) -> tuple[float, float, float]:
    """Return the corrections of position, velocity and acceleration over a span [s] of time."""
    rest = 1.0 - pole
    position = 1.0 - pole * pole * pole
    velocity = 1.5 * rest * rest * (1.0 + pole) / span
    return position, velocity, rest * rest * rest / (span * span)


def observe(
    p: ObserverParams,
    position: float,
    velocity: float,
    outside: float,
    sample: float,
    effort: float,
    periods: float,
) -> tuple[float, float, float]:
    """Move the observed state over `periods` and correct it by the sample at their end.

    Parameters
    ----------
    p : ObserverParams
        Constants.
    position, velocity : float
        Observed state at the sample before [rad or m, rad/s or m/s].
    outside : float
        Observed acceleration from outside [rad/s**2 or m/s**2].
    sample : float
        Measured position [rad or m].
    effort : float
        Mean of all resisting effort that acted meanwhile [N m or N].
    periods : float
        Periods since the sample before, >= 1. Missing samples widen the corrections, so that
        the memory fades with time and not with samples: p becomes p**periods.

    Returns
    -------
    tuple of float
        Position, velocity, acceleration from outside at this sample.
    """
    span = p.period
    half_square = p.half_square
    gain_x = p.position
    gain_v = p.velocity
    gain_w = p.disturbance
    if periods != 1.0:
        span = periods * span
        half_square = 0.5 * span * span
        if p.pole < 0.0:
            gain_v = gain_v / periods
        else:
            gain_x, gain_v, gain_w = observer_gains(p.pole**periods, span)
    push = outside - effort * p.inverse_mass
    ahead = position + span * velocity + half_square * push
    error = sample - ahead
    return (
        ahead + gain_x * error,
        velocity + span * push + gain_v * error,
        outside + gain_w * error,
    )


class ReactionParams(NamedTuple):
    """Constants of an observer of external efforts.

    mass [kg m**2 or kg], viscous [N m s/rad or N s/m] and coulomb [N m or N] friction as
    identified, `soft` [rad/s or m/s] the velocity at which the latter is in full.
    """

    observer: ObserverParams
    mass: float
    viscous: float
    coulomb: float
    soft: float


def reaction(p: ReactionParams, velocity: float, push: float) -> float:
    """Return the effort of hand or environment [N m or N] on a device.

    Parameters
    ----------
    p : ReactionParams
        Constants.
    velocity, push : float
        Observed velocity [rad/s or m/s] and acceleration from outside [rad/s**2 or m/s**2].
    """
    return p.mass * push + p.viscous * velocity + p.coulomb * clamp(velocity / p.soft, 1.0)
