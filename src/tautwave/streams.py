"""Seeded random streams: one per element and purpose, so that omitting one affects no other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

BLOCK = 4096  # drawn in blocks; the numbers equal those of one long draw

NOISE, MISSING, OVERRUN, HAND, SENSOR = 0, 1, 2, 3, 4
"""Purposes; the last word of a seed."""


SEED_WORD = 2**32
"""Of a whole number what is below it is a word of a seed: NumPy's are not negative."""

GRID = 8192
"""Frequencies of a colour's spectrum."""


def colour_taps(colour: Sequence[float]) -> Array:
    """Return the filter, shape (lags + 1,), that gives white noise a colour and leaves its size.

    `colour` is the autocorrelation from lag 1 on. The filter is the causal factor of the spectrum,
    found from its cepstrum (Kolmogorov); empty without a colour.
    """
    if not colour:
        return np.zeros(0)
    lags = np.zeros(GRID)
    lags[0] = 1.0
    lags[1 : len(colour) + 1] = colour
    lags[-len(colour) :] += np.asarray(colour, dtype=np.float64)[::-1]
    spectrum = np.fft.fft(lags).real
    cepstrum = np.fft.ifft(np.log(np.maximum(spectrum, 1e-9))).real
    cepstrum[GRID // 2] *= 0.5
    cepstrum[GRID // 2 + 1 :] = 0.0
    taps = np.fft.ifft(np.exp(np.fft.fft(cepstrum))).real[: len(colour) + 1]
    return np.asarray(taps / np.sqrt(np.sum(taps * taps)), dtype=np.float64)


def shaped(white: Array, taps: Array) -> Array:
    """Return filtered noise, shape (n - len(taps) + 1,); the same bits whatever the block."""
    if not len(taps):
        return white
    kept = len(white) - len(taps) + 1
    last = len(taps) - 1
    out = taps[0] * white[last:]
    for at in range(1, len(taps)):
        out += taps[at] * white[last - at : last - at + kept]
    return np.asarray(out, dtype=np.float64)


def normal_noise(seed: tuple[int, ...], count: int, colour: Sequence[float] = ()) -> Array:
    """Return the first numbers of `normal_stream`, shape (count,)."""
    taps = colour_taps(colour)
    rng = np.random.default_rng(seed)
    return shaped(rng.standard_normal(count + max(len(taps) - 1, 0)), taps)


def normal_stream(seed: tuple[int, ...], colour: Sequence[float] = ()) -> Iterator[float]:
    """Yield normal numbers of deviation 1 and a colour: autocorrelation from lag 1 on."""
    taps = colour_taps(colour)
    rng = np.random.default_rng(seed)
    before = rng.standard_normal(max(len(taps) - 1, 0))
    while True:
        white = np.append(before, rng.standard_normal(BLOCK))
        yield from shaped(white, taps).tolist()
        before = white[BLOCK:]


def uniform_stream(seed: tuple[int, ...]) -> Iterator[float]:
    """Yield numbers in [0, 1)."""
    rng = np.random.default_rng(seed)
    while True:
        yield from rng.random(BLOCK).tolist()
