"""Wave variables at a port, written out: what ports and lines are held against.

Source: Niemeyer & Slotine, "Stable adaptive teleoperation", IEEE J. Oceanic Eng. 16(1), 1991.
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
