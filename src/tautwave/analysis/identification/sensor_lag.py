"""A contact whose force is shown late: its sensor's lag as one more unknown.

A lag L of the force takes K L from the damping that is fitted, so a stiff contact seems to have a
negative one. No contact has that: L is at least -B / K. Beyond that, lag and damping differ in what
the force makes of accelerations only; where the motion does not tell, the least lag is taken, and
the interval says how far it may be off.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.contact_model import ContactFit, fit_contact
from tautwave.analysis.identification.contact_motion import motion_of
from tautwave.analysis.identification.regression import Array, Estimate, intervals

MAX_LAG_S = 0.02
"""Longest lag that is looked for; a sensor later than that is no sensor of a contact."""

BETTER = 0.995
"""Residual of a longer lag over that of the least one, to be taken instead."""

TRIED = 4


class Recorded(NamedTuple):
    """Position and force on even times, as they were recorded."""

    position: Array
    effort: Array
    period: float
    cutoff_hz: float
    known: NDArray[np.bool_]


def fit_lagged(seen: Recorded, plain: ContactFit) -> ContactFit | None:
    """Return a contact with the `lag` [s] of its sensor among the parameters, None if it has none.

    `plain` is the fit without a lag, whose damping is negative.
    """
    least = _least_lag(plain)
    if least is None or least > MAX_LAG_S:
        return None
    best: tuple[float, ContactFit] | None = None
    for _ in range(3):  # the damping of the delayed position is not quite K L less
        at = _fit(seen, plain.name, least)
        if at is None:
            return None
        best = least, at
        more = _least_lag(at)
        if more is None or more < 1e-3 * least:
            break
        least += more
    assert best is not None
    for lag in least * np.linspace(1.25, 2.5, TRIED):
        tried = _fit(seen, plain.name, float(lag))
        if tried is not None and tried.residual_rms < BETTER * best[1].residual_rms:
            best = float(lag), tried
    if best[0] > least:
        best = _refined(seen, plain.name, best, least)
    lag, chosen = best
    return chosen._replace(parameters={**chosen.parameters, "lag": _interval(seen, chosen, lag)})


def _refined(
    seen: Recorded, name: str, best: tuple[float, ContactFit], least: float
) -> tuple[float, ContactFit]:
    """Return the lowest point of a parabola through the residuals at three lags."""
    lag, fit = best
    step = 0.15 * lag
    ends = [_fit(seen, name, lag + sign * step) for sign in (-1.0, 1.0)]
    if ends[0] is None or ends[1] is None:
        return best
    low, middle, high = (one.residual_rms**2 for one in (ends[0], fit, ends[1]))
    bend = low - 2.0 * middle + high
    if bend <= 0.0:
        return best
    lag = max(lag + step * float(np.clip(0.5 * (low - high) / bend, -1.0, 1.0)), least)
    at_lag = _fit(seen, name, lag)
    return best if at_lag is None else (lag, at_lag)


def _least_lag(fit: ContactFit) -> float | None:
    damping, stiffness = fit.parameters.get("damping"), fit.parameters["stiffness"]
    if damping is None or damping.value >= 0.0 or stiffness.value <= 0.0:
        return None
    return -damping.value / stiffness.value


def _fit(seen: Recorded, name: str, lag: float) -> ContactFit | None:
    times = seen.period * np.arange(len(seen.position))
    late = np.interp(times - lag, times, seen.position)
    motion = motion_of(late, seen.effort, seen.period, cutoff_hz=seen.cutoff_hz, known=seen.known)
    return fit_contact(motion, name)


def _interval(seen: Recorded, fit: ContactFit, lag: float) -> Estimate:
    """The lag's interval, with all else fitted anew for each lag."""
    step = 0.05 * lag
    ends = [_fit(seen, fit.name, lag + sign * step) for sign in (1.0, -1.0)]
    if any(end is None or len(end.model) != len(fit.model) for end in ends):
        return Estimate(lag, 0.0, MAX_LAG_S)
    more, less = (np.asarray(end.model) for end in ends if end is not None)
    slope = (more - less) / (2.0 * step)
    [interval] = intervals(slope[:, None], fit.effort - fit.model, [lag])
    return Estimate(lag, max(interval.lower, 0.0), interval.upper)
