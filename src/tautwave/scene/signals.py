"""Outside forces of a scene, synthesised from a seed: tones, noise, taps."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def force_signal(
    keys: Mapping[str, Any], rate_hz: float, cycles: int, seed: tuple[int, int]
) -> Floats:
    """Return one force over time [N].

    Parameters
    ----------
    keys : mapping
        A block of a rig's `scene.forces`: `type` and the numbers of that type.
    rate_hz : float
        Samples per second.
    cycles : int
        Samples.
    seed : tuple of int
        Of the random ones.
    """
    time = np.arange(cycles) / rate_hz
    amplitude = float(keys["amplitude"])
    if keys["type"] == "sine":
        return np.asarray(amplitude * np.sin(2.0 * math.pi * keys["frequency_hz"] * time))
    random = np.random.default_rng(seed)
    if keys["type"] == "noise":
        return amplitude * _noise(random, cycles, rate_hz, keys["low_hz"], keys["high_hz"])
    return amplitude * _taps(random, cycles, rate_hz, keys["per_second"], keys["length_s"])


def _noise(
    random: np.random.Generator, cycles: int, rate_hz: float, low: float, high: float
) -> Floats:
    """Return noise of unit deviation between two corners [Hz], made in the spectrum."""
    spectrum = np.fft.rfft(random.standard_normal(cycles))
    frequency = np.fft.rfftfreq(cycles, 1.0 / rate_hz)
    kept = np.where((frequency >= low) & (frequency <= high), spectrum, 0.0)
    signal = np.fft.irfft(kept, cycles)
    size = float(np.sqrt(np.mean(signal * signal)))
    return np.asarray(signal / size if size > 0.0 else signal)


def _taps(
    random: np.random.Generator, cycles: int, rate_hz: float, per_second: float, length: float
) -> Floats:
    """Return half sines of random height up to 1, at random times."""
    signal = np.zeros(cycles)
    samples = max(round(length * rate_hz), 1)
    shape = np.sin(math.pi * (np.arange(samples) + 0.5) / samples)
    count = int(random.poisson(per_second * cycles / rate_hz))
    for start, height in zip(
        random.integers(0, cycles, count), random.uniform(0.2, 1.0, count), strict=True
    ):
        signal[start : start + samples] += height * shape[: cycles - start]
    return signal
