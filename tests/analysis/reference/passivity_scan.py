"""Where a controller gives energy, by scanning its frequency response."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.axis import Floats, PassivityMargin, _degrees, axis_grid
from tautwave.analysis.exact.positive_real import (
    Band,
)
from tautwave.analysis.exact.rational import Response


def scan_passivity(k: Response, low: float, high: float) -> PassivityMargin:
    """Return the phase margin of passivity in a band, for delayed and sampled functions.

    Ends of the bands are found to rounding; a band narrower than a 40th of a turn of the phase
    between two features (zeros, poles) may be missed. A rational function with a delay is never
    positive real on the whole axis, whatever this says of a part of it.

    Parameters
    ----------
    k : Response
        Controller.
    low, high : float
        Band [rad/s], 0 < low < high.

    Raises
    ------
    ConfigError
        If the band is empty or holds too many turns of the phase.
    """
    w = axis_grid(k, low, high)
    values = k.at(np.asarray(1j * w))
    sign = values.real < 0.0
    edges = [bisect(lambda x: k(1j * x).real, float(w[i]), float(w[i + 1])) for i in _changes(sign)]
    bounds = [low, *edges, high]
    starts = bounds[:-1] if sign[0] else bounds[1:-1]
    negative = tuple(
        Band(a, b) for a, b in zip(starts[::2], bounds[1 if sign[0] else 2 :: 2], strict=False)
    )
    phases = np.abs(np.degrees(np.angle(values)))
    at = int(np.argmax(np.round(phases, 9)))
    frequency = golden(lambda x: -abs(_degrees(k(1j * x))), w, at)
    crossing = [i for i in _changes(values.imag < 0.0) if sign[i] and sign[i + 1]]
    if crossing:
        at = crossing[0]
        frequency = bisect(lambda x: k(1j * x).imag, float(w[at]), float(w[at + 1]))
    phase = 180.0 if crossing else _degrees(k(1j * frequency))
    where = golden(lambda x: k(1j * x).real, w, int(np.argmin(values.real)))
    return PassivityMargin(90.0 - abs(phase), frequency, phase, negative, k(1j * where).real, where)


def golden(f: Callable[[float], float], w: Floats, at: int) -> float:
    """Return where f is least near w[at], by golden section between its neighbours."""
    low, high = float(w[max(at - 1, 0)]), float(w[min(at + 1, len(w) - 1)])
    ratio = (math.sqrt(5.0) - 1.0) / 2.0
    a, b = high - ratio * (high - low), low + ratio * (high - low)
    fa, fb = f(a), f(b)
    for _ in range(60):
        if fa < fb:
            high, b, fb = b, a, fa
            a = high - ratio * (high - low)
            fa = f(a)
        else:
            low, a, fa = a, b, fb
            b = low + ratio * (high - low)
            fb = f(b)
    best = 0.5 * (low + high)
    return best if f(best) <= f(float(w[at])) else float(w[at])


def bisect(f: Callable[[float], float], low: float, high: float) -> float:
    """Return where f changes sign between low and high."""
    below = f(low) < 0.0
    for _ in range(80):
        middle = 0.5 * (low + high)
        if (f(middle) < 0.0) == below:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _changes(sign: npt.NDArray[np.bool_]) -> list[int]:
    """Return where neighbours differ."""
    return [int(i) for i in np.flatnonzero(sign[1:] != sign[:-1])]
