"""Bode and Nyquist plots of a response, as arrays."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.axis import Floats, axis_grid
from tautwave.analysis.exact.rational import Response


class Curve(NamedTuple):
    """Arrays of one length for Bode and Nyquist plots; `passive` is where Re K >= 0.

    frequency_hz [Hz], magnitude_db [dB of N s/m or N m s/rad], phase_deg (unwrapped), real, imag.
    """

    frequency_hz: Floats
    magnitude_db: Floats
    phase_deg: Floats
    real: Floats
    imag: Floats
    passive: npt.NDArray[np.bool_]


def response(k: Response, frequency_hz: Floats) -> Curve:
    """Return the arrays of a Bode and a Nyquist plot at rising frequencies [Hz]."""
    values = k.at(2j * math.pi * np.asarray(frequency_hz, float))
    phase = np.degrees(np.unwrap(np.angle(values)))
    with np.errstate(divide="ignore"):
        decibels = 20.0 * np.log10(np.abs(values))
    return Curve(
        np.asarray(frequency_hz, float),
        decibels,
        phase,
        values.real.copy(),
        values.imag.copy(),
        values.real >= 0.0,
    )


def curve(k: Response, low_hz: float, high_hz: float, points: int = 2000) -> Curve:
    """Return `response` on a grid [Hz] that is fine around resonances."""
    turn = 2.0 * math.pi
    return response(k, axis_grid(k, turn * low_hz, turn * high_hz, points) / turn)
