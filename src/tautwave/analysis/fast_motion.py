"""The share of a motion's power that no hand makes by will."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from tautwave.types import VOLUNTARY_HZ

FASTEST_HZ = 100.0
"""Above it [Hz] a measured velocity is noise."""


def fast_share(position: npt.NDArray[Any], period: float, error: float = 0.0) -> float:
    """Return the share of velocity power up to 100 Hz that is above 8 Hz [1].

    Parameters
    ----------
    position : ndarray of shape (n,), float
        Positions [rad or m], a `period` [s] apart; of less than two swings at 8 Hz the share is 0.
    error : float
        Standard deviation of each [rad or m]: what it makes of fast motion does not count.
    """
    if len(position) * period * VOLUNTARY_HZ < 2.0:
        return 0.0
    moved = np.diff(position)
    at = np.fft.rfftfreq(len(moved), period)
    power = 2.0 * np.abs(np.fft.rfft(moved - np.mean(moved)) / len(moved)) ** 2
    power[at > FASTEST_HZ] = 0.0
    top = min(FASTEST_HZ, 0.5 / period)
    noise = 8.0 * math.pi**2 * error**2 * period**3 * (top**3 - VOLUNTARY_HZ**3) / 3.0
    fast = max(0.0, float(np.sum(power[at > VOLUNTARY_HZ])) - noise)
    whole = float(np.sum(power[at <= VOLUNTARY_HZ])) + fast
    return fast / whole if whole > 0.0 else 0.0
