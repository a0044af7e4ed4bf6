"""Quantum, standard deviation and autocorrelation of a position's noise, from a lever at rest.

The step is the spacing of the values' lattice. Drift is a curve of straight pieces of a second or
more: what moves slower takes nothing from a port. The variance of an encoder that the noise
dithers has q**2/12 from its step, which does not correlate (Widrow): it is taken off. Noise below
half a step cannot be separated from the step.

The lags are tapered, lag k by 1 - k/17, so that their spectrum is nowhere negative whatever was
measured (Bartlett 1950); a narrow band becomes as wide as 1/17 of the rate. Units are those of the
data, times in s.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.identification.regression import Array, Estimate, student_quantile
from tautwave.models.noise_colour import LAGS

MIN_SAMPLES = 1000
BLOCKS = 20
PIECE_S, PIECE_SAMPLES = 1.0, 2000
"""Least length of a straight piece of the drift, whichever is longer."""

REPEATED = 0.2
"""Most values per sample that are still steps of an encoder and no continuous signal."""

ON_LATTICE = 0.1  # rms distance from it, in steps; 0.29 for values that know of none
FINE = 0.02  # a step below this share of the deviation does not matter
DITHER = 0.6  # deviation in steps, the step's own part included, from which noise dithers
MAX_DRIFT = 10.0  # steps or deviations
MIN_PART = 500  # samples of a part that is looked at for motion
BURST, OFF = 3.0, 0.7  # deviation and mean of a part over the median deviation
SLOW = 8.0  # deviation over what differences of neighbours make of it if they were white


class NoiseFit(NamedTuple):
    """What an encoder makes of a lever at rest.

    `quantum` is 0 where values are finer than the noise, None where they never change. `deviation`
    is of the noise before the encoder rounds it; `autocorrelation` from lag 1 on, tapered, None
    where the noise is below the step, with `lag_error`, the greatest half-width of its 95 %
    intervals. `drift` is what was removed, from lowest to highest, `levels` the number of values.
    """

    quantum: float | None
    deviation: Estimate
    autocorrelation: tuple[float, ...] | None
    lag_error: float
    drift: float
    levels: int
    samples: int
    residual: Array


def fit_noise(position: Array, period: float, known: NDArray[np.bool_]) -> NoiseFit:
    """Return what the encoder makes of a lever that stands still.

    Parameters
    ----------
    position : array, (n,)
        [rad or m], on even times; anything where it is not `known`.
    period : float
        [s]
    known : array of bool, (n,)
        Which samples were measured.

    Raises
    ------
    ValueError
        Too few samples, or the lever moved; the message says which.
    """
    count = int(np.count_nonzero(known))
    if count < MIN_SAMPLES:
        raise ValueError(f"{count} samples are too few to estimate noise; {MIN_SAMPLES} are needed")
    values = position[known]
    step, levels = lattice(values)
    if levels == 1:
        return NoiseFit(None, Estimate(0.0, 0.0, 0.0), None, 0.0, 0.0, 1, count, 0.0 * position)
    drift = _drift(position, period, known)
    rest = np.where(known, position - drift, 0.0)
    spread = math.sqrt(float(np.sum(rest**2)) / count)
    _refuse_motion(rest, drift, period, known, spread, step)
    if step < FINE * spread:
        step = 0.0
    travel = float(np.ptp(drift[known]))
    blocks = [
        (float(np.mean(part[seen] ** 2)), _lags(part))
        for part, seen in zip(
            np.array_split(rest, BLOCKS), np.array_split(known, BLOCKS), strict=True
        )
        if np.any(seen)
    ]
    own = step * step / 12.0
    if spread < DITHER * step:
        steady = not _turns(values, step)
        deviation = _root(0.0 if steady else spread**2, [] if steady else [b[0] for b in blocks])
        return NoiseFit(step, deviation, None, 0.0, travel, levels, count, rest)
    deviation = _root(spread**2 - own, [b[0] - own for b in blocks])
    measured = _lags(rest) * spread**2 / (spread**2 - own)
    each = np.array([lags for _, lags in blocks]) * spread**2 / (spread**2 - own)
    half = student_quantile(len(each) - 1) * np.std(each, axis=0, ddof=1) / math.sqrt(len(each))
    taper = 1.0 - np.arange(1, LAGS + 1) / (LAGS + 1.0)
    lags = tuple(float(f"{value:.4f}") + 0.0 for value in np.clip(measured, -1.0, 1.0) * taper)
    return NoiseFit(step, deviation, lags, float(np.max(half)), travel, levels, count, rest)


def lattice(values: Array) -> tuple[float, int]:
    """Return the spacing of the values' lattice, 0 for none, and how many places of it occur.

    Values that differ by rounding errors only, by less than a fifth of all other differences, are
    one place.
    """
    places = np.unique(values)
    gaps = np.diff(places)
    if not len(gaps):
        return 0.0, 1
    sizes = np.sort(gaps)
    most = int(REPEATED * len(values))
    # The widest break between rounding errors and steps that leaves few enough places.
    least = 0.0
    if len(sizes) > 1:
        ratios = sizes[1:] / sizes[:-1]
        able = np.flatnonzero((ratios > 5.0) & (len(sizes) - 1 - np.arange(len(ratios)) < most))
        if len(able):
            least = float(sizes[able[np.argmax(ratios[able])]])
    if np.count_nonzero(gaps > least) >= most:
        return 0.0, len(places)
    group = np.concatenate([[0], np.cumsum(gaps > least)])
    centres = np.bincount(group, places) / np.bincount(group)
    steps = np.diff(centres)
    if not len(steps):
        return 0.0, 1
    for part in range(1, 9):
        trial = float(steps.min()) / part
        counts = np.rint(steps / trial)
        trial = float(np.sum(steps * counts) / np.sum(counts**2))
        off = steps / trial - counts
        if math.sqrt(float(np.mean(off**2))) < ON_LATTICE:
            return trial, len(centres)
    return 0.0, len(centres)


def _drift(position: Array, period: float, known: NDArray[np.bool_]) -> Array:
    """Return the straight pieces that fit best, joined."""
    size = max(round(PIECE_S / period), PIECE_SAMPLES)
    knots = np.linspace(0, len(position) - 1, max(len(position) // size, 1) + 1)
    at = np.arange(len(position), dtype=np.float64)
    columns = np.stack([np.interp(at, knots, unit) for unit in np.eye(len(knots))], axis=1)
    origin = float(np.median(position[known]))
    coefficients = np.linalg.lstsq(columns[known], position[known] - origin, rcond=None)[0]
    return np.asarray(origin + columns @ coefficients, dtype=np.float64)


def _refuse_motion(
    rest: Array, drift: Array, period: float, known: NDArray[np.bool_], spread: float, step: float
) -> None:
    """Raise ValueError where the lever drifts, was knocked, or moves slower than noise."""
    seen = known[2:] & known[1:-1] & known[:-2]
    bends = np.diff(rest, 2)[seen]
    quick = math.sqrt(float(np.mean(bends**2)) / 6.0) if len(bends) else 0.0
    scale = max(step, min(spread, SLOW * quick))
    if float(np.ptp(drift)) > MAX_DRIFT * scale:
        raise ValueError(
            f"it moved by {np.ptp(drift):.3g}, {np.ptp(drift) / scale:.3g} times its noise"
        )
    if spread > max(SLOW * quick, step):
        raise ValueError(
            f"it moved: {spread:.3g} rms, but only {quick:.2g} from one sample to the next"
        )
    parts = np.array_split(rest, min(BLOCKS, max(len(rest) // MIN_PART, 1)))
    deviations = np.array([float(np.std(part)) for part in parts])
    means = np.array([abs(float(np.mean(part))) for part in parts])
    usual = max(float(np.median(deviations)), step)
    worst = int(np.argmax(np.maximum(deviations / BURST, means / OFF)))
    if deviations[worst] > BURST * usual or means[worst] > OFF * usual:
        begin, length = (worst * len(parts[0]) * period, len(parts[0]) * period)
        raise ValueError(f"it moved between {begin:.3g} and {begin + length:.3g} s after the start")


def _turns(values: Array, step: float) -> bool:
    """Whether the values go back and forth, and do not only drift from step to step."""
    moves = np.diff(np.rint((values - values[0]) / step))
    moves = moves[moves != 0.0]
    return bool(np.any(moves[1:] * moves[:-1] < 0.0))


def _lags(rest: Array) -> Array:
    """Autocorrelation from lag 1 on, over the whole length: no spectrum of it is negative."""
    power = float(np.dot(rest, rest))
    if power == 0.0:
        return np.zeros(LAGS)
    return np.array([np.dot(rest[lag:], rest[:-lag]) / power for lag in range(1, LAGS + 1)])


def _root(variance: float, blocks: list[float]) -> Estimate:
    """Standard deviation, with the interval that the scatter of the blocks' variances gives."""
    half = 0.0
    if len(blocks) > 1:
        scatter = float(np.std(blocks, ddof=1)) / math.sqrt(len(blocks))
        half = student_quantile(len(blocks) - 1) * scatter
    ends = [math.sqrt(max(value, 0.0)) for value in (variance - half, variance, variance + half)]
    return Estimate(ends[1], ends[0], ends[2])
