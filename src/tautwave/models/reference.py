"""Reference motion of the hand: closed forms of time."""

from __future__ import annotations

import math


def minimum_jerk(fraction: float) -> float:
    """Quintic from 0 to 1 with zero velocity and acceleration at both ends (Flash, Hogan 1985)."""
    if fraction <= 0.0:
        return 0.0
    if fraction >= 1.0:
        return 1.0
    if fraction > 0.5:
        return 1.0 - minimum_jerk_half(1.0 - fraction)
    return minimum_jerk_half(fraction)


def minimum_jerk_half(s: float) -> float:
    """The quintic itself, accurate for `s` up to one half."""
    return s * s * s * (10.0 - s * (15.0 - 6.0 * s))


def minimum_jerk_position(t: float, t0: float, x0: float, t1: float, x1: float) -> float:
    """Position at `t` [s] of a minimum-jerk move from x0 at t0 to x1 at t1; held outside."""
    if not t1 > t0:
        if t < t0:
            return x0
        return x1
    s = minimum_jerk((t - t0) / (t1 - t0))
    if s == 1.0:
        return x1
    return x0 + (x1 - x0) * s


def sine_position(t: float, frequency: float, amplitude: float, phase: float) -> float:
    """One component `amplitude sin(2 pi frequency t + phase)` of a multisine [Hz, unit, rad]."""
    return amplitude * math.sin(2.0 * math.pi * frequency * t + phase)


def ramp_gain(t: float, ramp_s: float) -> float:
    """Gain from 0 at t = 0 to 1 at `ramp_s` [s], minimum jerk; 1 throughout without a ramp."""
    if not ramp_s > 0.0:
        return 1.0
    return minimum_jerk(t / ramp_s)
