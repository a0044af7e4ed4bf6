"""Llewellyn's verdict over a whole band, refined where it is closest."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.two_port import NOISE, Response, llewellyn

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

TIGHT = 1e-9
"""Share of what is subtracted that still counts as zero: a lossless line sits on the limit."""


class Absolute(NamedTuple):
    """Result of `absolute_stability`.

    Attributes
    ----------
    stable : bool
        Llewellyn's verdict in the band, to rounding.
    eta : float
        Least (2 Re h11 Re h22 - Re h12 h21) / |h12 h21| [1]; stable from 1 on. Near s = 0 it goes
        to 1 in many rigs, so the verdict uses `share`.
    share : float
        Least of eta - 1 per sum of what it is the difference of, in [-1, 1]; >= 0 is stable.
    frequency : float
        Where the share is least [rad/s]; `low` itself stands for s -> 0.
    resistance, conductance : float
        Least Re h11 [N s/m or N m s/rad] and Re h22 [its inverse].
    """

    stable: bool
    eta: float
    share: float
    frequency: float
    resistance: float
    conductance: float


def absolute_stability(response: Response, low: float, high: float, points: int = 2000) -> Absolute:
    """Return Llewellyn's verdict between two frequencies [rad/s], refined where it is closest.

    Parameters
    ----------
    response : callable
        H at an array of points s.
    low, high : float
        Band [rad/s]; `low` far below everything (1e-3) is the limit s -> 0.
    points : int
        Of the first, logarithmic grid; where the delay turns the phase by more than a twentieth
        of a turn per point give more.
    """
    w = np.geomspace(low, high, points)
    h = response(np.asarray(1j * w))
    sizes = (float(np.median(np.abs(h.h11))), float(np.median(np.abs(h.h22))))

    def share_at(w: Floats) -> Floats:
        return llewellyn(response(np.asarray(1j * w)), sizes)[1]

    def excess_at(w: Floats) -> Floats:
        excess, share = llewellyn(response(np.asarray(1j * w)), sizes)
        return np.where(share == 0.0, 0.0, excess)

    def resistance_at(w: Floats) -> Floats:
        return _real(response(np.asarray(1j * w)).h11, sizes[0])

    def conductance_at(w: Floats) -> Floats:
        return _real(response(np.asarray(1j * w)).h22, sizes[1])

    frequency, share = refined_minimum(share_at, w)
    _, excess = refined_minimum(excess_at, w)
    at_r, resistance = refined_minimum(resistance_at, w)
    at_g, conductance = refined_minimum(conductance_at, w)
    if min(resistance, conductance) < 0.0 <= share:
        frequency = at_r if resistance < 0.0 else at_g
    stable = share >= -TIGHT and resistance >= 0.0 and conductance >= 0.0
    return Absolute(stable, 1.0 + excess, share, frequency, resistance, conductance)


def _real(value: Complexes, size: float) -> Floats:
    """Return the real part, 0 where it is rounding."""
    noise = NOISE * (size + np.abs(value)) * (1.0 + np.abs(value) / size)
    return np.where(np.abs(value.real) <= noise, 0.0, value.real)


def refined_minimum(
    value: Callable[[Floats], Floats], w: Floats, basins: int = 8
) -> tuple[float, float]:
    """Return where a function is least and its value: a grid, then the lowest basins refined."""
    values = value(w)
    low = np.concatenate([[np.inf], values[:-1]])
    high = np.concatenate([values[1:], [np.inf]])
    dips = np.flatnonzero((values <= low) & (values <= high))
    best = int(np.argmin(values))
    place, least = float(w[best]), float(values[best])
    for dip in dips[np.argsort(values[dips])][:basins]:
        at, grid, found = int(dip), w, values
        for _ in range(9):
            grid = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)], 17)
            found = value(grid)
            at = int(np.argmin(found))
        if found[at] < least:
            place, least = float(grid[at]), float(found[at])
    return place, least
