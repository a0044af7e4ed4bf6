"""Colour of an encoder's noise: its autocorrelation over a few samples, and the spectrum of that.

The noise n of a still lever has r_k = mean(n[j] n[j+k]) / mean(n**2); lags beyond the last one that
is given count as zero. Its spectrum, of mean 1 over theta in [0, pi] [rad per sample], is

    S(theta) = 1 + 2 sum r_k cos(k theta),

and no noise has one that is negative (Herglotz).
"""

from __future__ import annotations

import math

LAGS = 16
"""Most lags that are declared of an axis."""

TOLERANCE = 0.01
"""By which the spectrum of rounded lags may be negative, as a share of its mean."""

POINTS = 8
"""Frequencies per lag at which a spectrum is looked at: between them it dips by under 4 %."""


def spectrum(autocorrelation: tuple[float, ...], theta: float) -> float:
    """Return S at a frequency [rad per sample], of mean 1."""
    total = 1.0
    for lag, ratio in enumerate(autocorrelation, 1):
        total += 2.0 * ratio * math.cos(lag * theta)
    return total


def least_spectrum(autocorrelation: tuple[float, ...]) -> tuple[float, float]:
    """Return the least S, and the frequency at which it is [rad per sample]."""
    return min((spectrum(autocorrelation, theta), theta) for theta in _looked_at(autocorrelation))


def greatest_spectrum(autocorrelation: tuple[float, ...] | None) -> float:
    """Return the greatest S; of an unknown colour (None) that of any with `LAGS` lags.

    A cosine sum of degree n that is nowhere negative is at most n + 1 times its mean (Fejer), and
    falls from its greatest value M to no less than M cos(n d) within d (M. Riesz).
    """
    if autocorrelation is None:
        return LAGS + 1.0
    greatest = max(spectrum(autocorrelation, theta) for theta in _looked_at(autocorrelation))
    return min(greatest / math.cos(0.5 * math.pi / POINTS), len(autocorrelation) + 1.0)


def _looked_at(autocorrelation: tuple[float, ...]) -> list[float]:
    count = POINTS * (len(autocorrelation) + 1)
    return [math.pi * at / count for at in range(count + 1)]
