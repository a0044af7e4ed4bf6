"""Resample series: at their common instants, and between samples."""

from __future__ import annotations

import numpy as np

from tautwave.report.figures.envelope import Floats


def distance(t: Floats, x: Floats, u: Floats, y: Floats) -> Floats:
    """Return y - x at the common instants [s] of both series, one-dimensional, without NaN."""
    if len(t) < 2 or len(u) < 2:
        return np.zeros(0)
    tick = 0.25 * min(float(np.min(np.diff(t))), float(np.min(np.diff(u))))
    near = np.clip(np.searchsorted(u, t - tick), 0, len(u) - 1)
    both = np.abs(u[near] - t) <= tick
    gap = np.asarray(y[near][both] - x[both], dtype=np.float64)
    return gap[np.isfinite(gap)]


def resampled(at: Floats, time: Floats, values: Floats) -> Floats:
    """Return a series at other instants [s]: cubic between samples, held outside.

    Halving the rate selects samples; nothing is filtered.
    """
    if len(time) < 3:
        return np.full(len(at), values[0] if len(values) else 0.0)
    slope = np.gradient(values, time)
    where = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
    step = time[where + 1] - time[where]
    s = np.clip((at - time[where]) / step, 0.0, 1.0)
    one, two = values[where], values[where + 1]
    rise = two - one
    a, b = slope[where] * step - rise, slope[where + 1] * step - rise
    curve = one + s * rise + s * (1.0 - s) * ((1.0 - s) * a - s * b)
    # Apart from rounding, existing samples are unchanged.
    curve = np.where(s < 1e-6, one, curve)
    return np.where(s > 1.0 - 1e-6, two, curve)
