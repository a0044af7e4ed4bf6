"""Wave variables at a port, and a low-pass filter in the wave domain.

Sources: Niemeyer & Slotine, "Stable adaptive teleoperation", IEEE J. Oceanic Eng. 16(1), 1991
(wave variables); Fettweis, "Wave digital filters", Proc. IEEE 74(2), 1986 (power waves).
"""

from __future__ import annotations

import math


def encode_wave(effort: float, velocity: float, impedance: float) -> float:
    """Return the wave that leaves a port.

    Parameters
    ----------
    effort : float
        Resisting effort of the line on the device [N m or N].
    velocity : float
        Velocity of the device [rad/s or m/s].
    impedance : float
        Wave impedance b > 0 [N m s/rad or N s/m].

    Returns
    -------
    float
        Leaving wave u = (b v + R) / sqrt(2 b) [W**0.5]; R v = (u**2 - arriving**2) / 2.
    """
    return (impedance * velocity + effort) / math.sqrt(2.0 * impedance)


def decode_effort(arriving: float, velocity: float, impedance: float) -> float:
    """Return the resisting effort b v - sqrt(2 b) arriving [N m or N] of a port at `velocity`."""
    return impedance * velocity - math.sqrt(2.0 * impedance) * arriving


def decode_velocity(arriving: float, effort: float, impedance: float) -> float:
    """Return the velocity (R + sqrt(2 b) arriving) / b [rad/s or m/s] of a port under `effort`."""
    return (effort + math.sqrt(2.0 * impedance) * arriving) / impedance


def filter_gain(corner_hz: float, period: float) -> float:
    """Return the step a = 1 - exp(-2 pi f T) of a first-order low-pass, 0 < a <= 1."""
    return 1.0 - math.exp(-2.0 * math.pi * corner_hz * period)


def filter_step(
    gain: float, period: float, state: float, wave: float
) -> tuple[float, float, float]:
    """Low-pass one wave; |H| <= 1, so the filter is passive.

    Parameters
    ----------
    gain : float
        Step of `filter_gain`.
    period : float
        Loop period T [s].
    state : float
        Last filtered wave y [W**0.5].
    wave : float
        Wave to filter [W**0.5].

    Returns
    -------
    tuple of float
        Filtered wave [W**0.5], energy now stored, energy dissipated in this step [J].

    Notes
    -----
    With y+ = y + a (u - y): u**2 - y+**2 = c (y+**2 - y**2) + (c / a) (y+ - y)**2, c = (1-a)/a.
    Both terms are written down here, none is the difference of the others.
    """
    step = gain * (wave - state)
    filtered = state + step
    ratio = (1.0 - gain) / gain
    stored = 0.5 * period * ratio * filtered * filtered
    dissipated = 0.5 * period * (ratio / gain) * step * step
    return filtered, stored, dissipated
