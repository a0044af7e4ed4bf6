"""A low-pass filter in the wave domain.

Source: Fettweis, "Wave digital filters", Proc. IEEE 74(2), 1986 (power waves).
"""

from __future__ import annotations

import math


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
