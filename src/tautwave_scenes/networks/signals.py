"""External forces of a scene: tones, noise and taps from a seed, and sounds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from fractions import Fraction
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
        Seed of the random ones.
    """
    time = np.arange(cycles) / rate_hz
    amplitude = float(keys["amplitude"])
    if keys["type"] == "sine":
        return np.asarray(amplitude * np.sin(2.0 * math.pi * keys["frequency_hz"] * time))
    random = np.random.default_rng(seed)
    if keys["type"] == "noise":
        return amplitude * _noise(random, cycles, rate_hz, keys["low_hz"], keys["high_hz"])
    return amplitude * _taps(random, cycles, rate_hz, keys["per_second"], keys["length_s"])


def sound_signal(
    keys: Mapping[str, Any], samples: Floats, sound_hz: float, rate_hz: float, cycles: int
) -> Floats:
    """Return the force of a sound over time [N].

    Parameters
    ----------
    keys : mapping
        A block of a rig's `scene.forces` of type sound: `amplitude`, `channel`, `loop`, `start_s`.
    samples : (frames, channels)
        The sound, in full scales.
    sound_hz, rate_hz : float
        Its samples per second, and the scene's.
    cycles : int
        Samples of the scene.
    """
    channel = keys["channel"]
    one = samples.mean(axis=1) if channel == "mono" else samples[:, channel - 1]
    if sound_hz != rate_hz:
        # Slow to import, and not needed for a sound at the scene's own rate.
        from scipy.signal import resample_poly

        ratio = Fraction(rate_hz / sound_hz).limit_denominator(10_000)
        one = resample_poly(one, ratio.numerator, ratio.denominator)
    signal = np.zeros(cycles)
    first = min(round(keys["start_s"] * rate_hz), cycles)
    room = cycles - first
    played = np.resize(one, room) if keys["loop"] else one[:room]
    signal[first : first + len(played)] = float(keys["amplitude"]) * played
    return signal


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
