"""Least squares on recorded motion: one filter for force and motion, honest confidence.

A differential equation is fitted by convolving all of it with one smooth kernel. Derivatives then
fall on the kernel and not on the data, so that noise is not differentiated and nothing is biased
by the lag of a backward difference; force and motion pass the same filter (the off-line,
lag-free form of the state-variable filter). Units are those of the data, times in s.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REACH = 7.0  # standard deviations of the kernel kept on each side: 2e-11 is left out
MIN_WIDTH = 1.5  # [samples] of the standard deviation: narrower, the kernel itself aliases
BLOCKS = 20
Z_95 = 1.959963984540054


class Estimate(NamedTuple):
    """A number and its 95 % interval."""

    value: float
    lower: float
    upper: float

    def scaled(self, factor: float) -> Estimate:
        """Return the estimate of `factor` times the quantity."""
        ends = (factor * self.lower, factor * self.upper)
        return Estimate(factor * self.value, min(ends), max(ends))


class Kernel:
    """A Gaussian low-pass and its derivatives, sampled.

    Parameters
    ----------
    period : float
        Of the samples [s].
    cutoff_hz : float
        Where it lets through 1/sqrt 2; at most 0.088 of the sampling rate.
    """

    def __init__(self, period: float, cutoff_hz: float) -> None:
        self.period = period
        width = math.sqrt(math.log(2.0)) / (2.0 * math.pi * cutoff_hz * period)
        self.width = max(width, MIN_WIDTH)
        self.half = math.ceil(REACH * self.width)
        self.step = max(1, int(self.width))
        at = np.arange(-self.half, self.half + 1) / self.width
        bell = np.exp(-0.5 * at * at)
        bell /= bell.sum()
        rate = 1.0 / (self.width * period)
        self._taps = (bell, -at * bell * rate, (at * at - 1.0) * bell * rate * rate)
        self._bell = bell

    @property
    def cutoff_hz(self) -> float:
        """The cut-off as it is [Hz]."""
        return math.sqrt(math.log(2.0)) / (2.0 * math.pi * self.width * self.period)

    def apply(self, values: Array, order: int = 0) -> Array:
        """Filtered derivative of `order` 0 to 2, at samples `half` to `len - half - 1`."""
        return _convolve(values, self._taps[order])

    def apply_held(self, values: Array, delay: float = 0.0) -> Array:
        """Filtered signal that is held from each sample to the next, `delay` [samples] later.

        Exact: the kernel is integrated over each hold. Before the first sample there is nothing.
        """
        whole = math.floor(delay)
        held = np.concatenate([np.zeros(whole), values])[: len(values)]
        root = self.width * math.sqrt(2.0)
        edge = np.arange(-self.half - 1, self.half + 1) - (delay - whole)
        total = np.array([0.5 * math.erf(value / root) for value in edge])
        return _convolve(held, total[1:] - total[:-1])

    def mass(self, marked: NDArray[np.bool_]) -> Array:
        """Share of the kernel, 0 to 1, that falls on marked samples."""
        return _convolve(marked.astype(np.float64), self._bell)

    def noise_gain(self, order: int) -> float:
        """Standard deviation that white noise of 1 leaves in the filtered derivative."""
        return float(np.sqrt(np.sum(self._taps[order] ** 2)))


def _convolve(values: Array, taps: Array) -> Array:
    """Valid part of a convolution by FFT in overlapping blocks; result k is at sample k + half."""
    size = len(taps)
    out = len(values) - size + 1
    if out < 1:
        return np.empty(0)
    block = max(1 << 14, 1 << (2 * size - 1).bit_length())
    spectrum = np.fft.rfft(taps, block)
    result = np.empty(out)
    hop = block - size + 1
    for begin in range(0, out, hop):
        part = np.fft.irfft(np.fft.rfft(values[begin : begin + block], block) * spectrum, block)
        end = min(begin + hop, out)
        result[begin:end] = part[size - 1 : size - 1 + end - begin]
    return result


def student_quantile(freedom: int) -> float:
    """97.5 % quantile of Student's t by Cornish and Fisher; 0.2 % off at 4 degrees of freedom."""
    z, n = Z_95, float(max(freedom, 1))
    return (
        z
        + (z**3 + z) / (4.0 * n)
        + (5.0 * z**5 + 16.0 * z**3 + 3.0 * z) / (96.0 * n**2)
        + (3.0 * z**7 + 19.0 * z**5 + 17.0 * z**3 - 15.0 * z) / (384.0 * n**3)
    )


def solve(columns: Array, target: Array) -> Array:
    """Least-squares coefficients, columns scaled to one size first."""
    size = np.sqrt(np.mean(columns**2, axis=0))
    size[size == 0.0] = 1.0
    scaled = np.linalg.lstsq(columns / size, target, rcond=1e-12)[0]
    return np.asarray(scaled / size, dtype=np.float64)


def intervals(
    slopes: Array, residual: Array, values: Sequence[float], blocks: int = BLOCKS
) -> tuple[Estimate, ...]:
    """95 % intervals of fitted parameters.

    Filtered residuals are correlated, and a model is never quite right, so nothing is assumed of
    them within `blocks` contiguous stretches of the rows: the scatter of the stretches' own
    pulls on the parameters gives the covariance (batch means, a sandwich estimate).

    Parameters
    ----------
    slopes : array, (rows, parameters)
        Derivative of the model in each parameter: the columns of a linear fit.
    residual : array, (rows,)
        In the unit of the target.
    values : sequence of float
        The parameters found.
    """
    size = np.sqrt(np.mean(slopes**2, axis=0))
    size[size == 0.0] = 1.0
    scaled = slopes / size
    count = max(min(blocks, len(residual) // max(1, 2 * len(values))), 2)
    edges = np.linspace(0, len(residual), count + 1).astype(int)
    pulls = np.add.reduceat(scaled * residual[:, None], edges[:-1], axis=0)
    inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-13)
    covariance = inverse @ (pulls.T @ pulls) @ inverse * count / max(count - len(values), 1)
    half = student_quantile(max(count - len(values), 1)) * np.sqrt(np.diag(covariance)) / size
    return tuple(
        Estimate(float(value), float(value - h), float(value + h))
        for value, h in zip(values, half, strict=True)
    )


def goodness(target: Array, residual: Array) -> tuple[float, float]:
    """Root mean square of the residual [target's unit], and the share of variance explained."""
    spread = float(np.var(target))
    square = float(np.mean(residual**2))
    return math.sqrt(square), 1.0 - square / spread if spread > 0.0 else 0.0


def white_noise(position: Array, known: NDArray[np.bool_] | None = None) -> float:
    """Standard deviation of the white noise in a smooth motion, from fourth differences."""
    squares = noise_squares(position, known)
    return math.sqrt(float(np.mean(squares))) if len(squares) else 0.0


def noise_squares(position: Array, known: NDArray[np.bool_] | None = None) -> Array:
    """Squares whose mean is the variance of the white noise in a smooth motion.

    Of five `known` samples in succession, where there are any: what fills a gap has kinks.
    """
    steps = np.diff(position, 4)
    if known is not None:
        whole = np.convolve(known, np.ones(5), "valid") > 4.5
        steps = steps[whole] if whole.any() else steps
    return np.asarray(steps**2 / 70.0)


class RecursiveLeastSquares:
    """Least squares, row by row: after the last row the same as all at once.

    Parameters
    ----------
    size : int
        Number of coefficients.
    forgetting : float
        Weight of the past per row, 0 to 1; 1 forgets nothing.
    scales : sequence of float, optional
        Typical size of each column: only the start, which knows nothing, depends on it.
    """

    def __init__(
        self, size: int, forgetting: float = 1.0, scales: Sequence[float] | None = None
    ) -> None:
        self.coefficients = np.zeros(size)
        self._forgetting = forgetting
        self._scales = np.ones(size) if scales is None else np.asarray(scales, dtype=np.float64)
        self._root: Array = np.zeros((size + 1, size + 1))

    def update(self, row: Array, target: float) -> Array:
        """Take one row; return the coefficients so far (zeros until they are determined).

        The triangular factor of the normal equations is updated by Givens rotations: a
        covariance that is updated instead loses half the digits.
        """
        size = len(self.coefficients)
        root = self._root
        if self._forgetting != 1.0:
            root *= math.sqrt(self._forgetting)
        new = np.append(np.asarray(row, dtype=np.float64) / self._scales, target)
        for at in range(size):
            if new[at] == 0.0:
                continue
            length = math.hypot(root[at, at], new[at])
            cosine, sine = root[at, at] / length, new[at] / length
            old = root[at, at:].copy()
            root[at, at:] = cosine * old + sine * new[at:]
            new[at:] = cosine * new[at:] - sine * old
        diagonal = np.abs(np.diag(root)[:size])
        if diagonal.min() > 1e-9 * diagonal.max():
            coefficients = np.linalg.solve(root[:size, :size], root[:size, size])
            self.coefficients = coefficients / self._scales
        return self.coefficients
