"""One filter on motion and effort, so that a regression of the one on the other has no phase.

An observer of external efforts (`laws.observer`, a triple pole p) shows of an effort f, held over
each period,

    H(z) f,  H = (1 - p)**3 / 2 z (z + 1) / (z - p)**3:

three first-order low-passes after the mean of two neighbouring periods. An environment K x + B v
that acts meanwhile has the mean K (x[k] + x[k+1]) / 2 + B (x[k+1] - x[k]) / T over a period. So
position and velocity that went the same way are (x[k] + 2 x[k-1] + x[k-2]) / 4 and
(x[k] - x[k-2]) / 2T, each through the same three low-passes: exact, whatever p. A measured effort
is filtered here as positions are.

Source: derived here; one filter on all signals of a regression is Young's prefilter (1964).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple


class SignalParams(NamedTuple):
    """Of one axis: the filter's pole p [1] and 1 / 2T [1/s]."""

    pole: float
    per_two_periods: float


@dataclass(slots=True)
class Filter:
    """The last two samples of a signal, and what the three low-passes hold of its mean."""

    newest: float = 0.0
    before: float = 0.0
    first: float = 0.0
    second: float = 0.0
    mean: float = 0.0


@dataclass(slots=True)
class Slope:
    """What the three low-passes hold of a signal's derivative."""

    first: float = 0.0
    second: float = 0.0
    mean: float = 0.0


def begin_filter(s: Filter, sample: float) -> None:
    """Begin as if the signal had always been `sample`."""
    s.newest = sample
    s.before = sample
    s.first = sample
    s.second = sample
    s.mean = sample


def begin_slope(s: Slope) -> None:
    """Begin at rest."""
    s.first = 0.0
    s.second = 0.0
    s.mean = 0.0


def pass_slope(p: SignalParams, s: Slope, f: Filter, sample: float) -> None:
    """Filter the derivative, by the sample that comes next; before `pass_filter`."""
    rest = 1.0 - p.pole
    s.first += rest * ((sample - f.before) * p.per_two_periods - s.first)
    s.second += rest * (s.first - s.second)
    s.mean += rest * (s.second - s.mean)


def pass_filter(p: SignalParams, s: Filter, sample: float) -> None:
    """Filter the next sample."""
    rest = 1.0 - p.pole
    s.first += rest * (0.25 * (sample + 2.0 * s.newest + s.before) - s.first)
    s.second += rest * (s.first - s.second)
    s.mean += rest * (s.second - s.mean)
    s.before = s.newest
    s.newest = sample
