"""Waves between rates, through gaps and through rounding: what keeps their energy, what adds to it.

A wave's energy is T u**2 / 2 per sample of length T. A linear conversion of blocks is a matrix;
its greatest energy ratio is the square of its greatest singular value, which a pattern of input
reaches. Above 1 the element feeds the loop, and no passive line is left.

Sources: Cauchy & Schwarz (the mean), Niemeyer & Slotine 1998 (wave integrals with energy), Lozano,
Chopra & Spong 2002 (gain of a moving delay); ratios written here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]


class Policy(NamedTuple):
    """What a receiver does about a wave that is missing, late or doubled.

    Attributes
    ----------
    name : str
    passive : bool
    energy_ratio : float
        Greatest energy out per energy in over `lost` losses in a row; inf where one packet can
        come back any number of times.
    remark : str
        What it costs, or why it is not passive.
    """

    name: str
    passive: bool
    energy_ratio: float
    remark: str


def packet_policies(lost: int = 100) -> tuple[Policy, ...]:
    """Return the table of receiver policies; `lost` losses in a row are allowed for."""
    return (
        Policy("null", True, 1.0, "sends 0 for what is missing: loses energy and drifts"),
        Policy("hold last", False, held_ratio(lost), "pays the last wave out again and again"),
        Policy(
            "newest, unchecked", False, math.inf, "doubled and reordered packets are paid out twice"
        ),
        Policy("play-out buffer", True, 1.0, "late is lost, doubled is dropped; adds its delay"),
        Policy("interpolate", False, held_ratio(lost), "stretched waves carry stretched energy"),
        Policy("scaled hold", True, 1.0, "1/sqrt(n) needs the number of losses beforehand"),
        Policy("wave integral", True, 1.0, "pays out no more than was sent; drift-free"),
    )


def held_ratio(lost: int) -> float:
    """Return the energy ratio of holding a wave over `lost` missing ones: 1 + lost [1]."""
    return 1.0 + lost


def delay_gain(rate: float) -> float:
    """Return sqrt(1 - rate): the gain that keeps a delay growing by `rate` [s/s] passive [1]."""
    return math.sqrt(max(0.0, 1.0 - rate))


# -- between rates ---------------------------------------------------------------------------------


def mean_matrix(count: int) -> Matrix:
    """Return fast to slow by the mean of each block of `count`; shape (1, count)."""
    return np.full((1, count), 1.0 / count)


def pick_matrix(count: int) -> Matrix:
    """Return fast to slow by every `count`-th wave; shape (1, count)."""
    out = np.zeros((1, count))
    out[0, -1] = 1.0
    return out


def hold_matrix(count: int) -> Matrix:
    """Return slow to fast by holding each wave for `count` periods; shape (count, 1)."""
    return np.ones((count, 1))


def conversion_ratio(matrix: Matrix) -> float:
    """Return the greatest energy out per energy in of a conversion of blocks [1].

    A block lasts as long before and after, so its waves are as many times shorter as there are
    more of them: |C|**2 (waves in) / (waves out).
    """
    rows, columns = (int(count) for count in matrix.shape)
    size = float(np.linalg.norm(matrix, 2))
    return size * size * (columns / rows)


def mean_magnitude(frequency: float, count: int, period: float) -> float:
    """Return |H| of the mean over `count` waves at a frequency [Hz], `period` [s] the fast one."""
    half = math.pi * frequency * period
    if math.sin(half) == 0.0:
        return 1.0
    return abs(math.sin(count * half) / (count * math.sin(half)))


# -- rounding --------------------------------------------------------------------------------------


def truncate_wave(wave: float, step: float) -> float:
    """Return the wave cut to the next multiple of `step` towards 0: passive."""
    return math.copysign(math.floor(abs(wave) / step) * step, wave)


def round_wave(wave: float, step: float) -> float:
    """Return the wave at the nearest multiple of `step`: up to four times its energy."""
    return math.floor(wave / step + 0.5) * step


def rounding_ratio(wave: float, step: float) -> float:
    """Return the energy ratio of rounding one wave [1]; 1 of 0.6 step is 2.7778."""
    if wave == 0.0:
        return 1.0
    ratio = round_wave(wave, step) / wave
    return ratio * ratio
