"""A sensor of the effort between a device and what is outside it: lag, delay, noise, steps."""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.models.encoder import quantise


class SensorParams(NamedTuple):
    """A sensor, per period of its axis.

    `mass` [kg or kg m2] moves with the device beyond the sensor (the hand's); `keep` is the share
    of its reading that a first-order low-pass keeps in a period, `delay` in periods; `scale` is
    what it shows for a unit of effort, `offset` what it shows without any, `noise` a standard
    deviation and `quantum` its step [N m or N].
    """

    mass: float
    keep: float
    delay: int
    scale: float
    offset: float
    noise: float
    quantum: float


NO_SENSOR = SensorParams(0.0, 0.0, 0, 1.0, 0.0, 0.0, 0.0)


def sensor_keep(bandwidth_hz: float | None, period: float) -> float:
    """Return the share that a low-pass of this cut-off [Hz] keeps in a period; None: no lag."""
    if bandwidth_hz is None:
        return 0.0
    return math.exp(-2.0 * math.pi * bandwidth_hz * period)


def follow_effort(p: SensorParams, state: float, effort: float) -> float:
    """Return the low-passed effort after a period that ends with `effort` [N m or N]."""
    return effort + p.keep * (state - effort)


def sensor_reading(p: SensorParams, effort: float, noise: float) -> float:
    """Return what is shown of an effort [N m or N]; `noise` is of standard deviation 1."""
    value = p.scale * effort + p.offset + p.noise * noise
    if p.quantum > 0.0:
        value = quantise(value, p.quantum)
    return value
