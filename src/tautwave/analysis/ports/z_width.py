"""How well a rig shows its environment: least and greatest impedance, Z-width, transparency.

Z_min is what the hand feels in free motion (F_s = 0), Z_max against a clamp (v_s = 0). Between
them lies what a rig can show. Transparency is the ratio of what is felt to what is touched, over a
stated band and a stated class of environments: there is no transparency as such.

Sources: Colgate & Brown, ICRA 1994 (Z-width); Hannaford 1989, Lawrence 1993 (transparency).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.two_port import Hybrid, Response

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


class Environment(NamedTuple):
    """Mass, damping and stiffness that the slave touches; SI."""

    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0

    def impedance(self, s: Complexes) -> Complexes:
        """Return m s + b + k / s."""
        return np.asarray(self.mass * s + self.damping + self.stiffness / s)


def transmitted(h: Hybrid, environment: Complexes) -> Complexes:
    """Return the impedance at the hand with `environment` at the slave [N s/m or N m s/rad]."""
    return np.asarray(h.h11 - h.h12 * h.h21 * environment / (1.0 + h.h22 * environment))


def least_impedance(h: Hybrid) -> Complexes:
    """Return Z_min = h11, felt in free motion."""
    return h.h11


def greatest_impedance(h: Hybrid) -> Complexes:
    """Return Z_max = h11 - h12 h21 / h22, felt against a clamped slave."""
    return np.asarray(h.h11 - h.h12 * h.h21 / h.h22)


class Width(NamedTuple):
    """Z-width of a band: mean |ln|Z_max| - ln|Z_min|| [1], and the same in dB."""

    width: float
    decibels: float


def z_width(response: Response, low: float, high: float, points: int = 2000) -> Width:
    """Return (1 / (w2 - w1)) times the integral of |ln|Z_max| - ln|Z_min|| over [w1, w2] rad/s."""
    w = np.linspace(low, high, points)
    h = response(np.asarray(1j * w))
    apart = np.abs(np.log(np.abs(greatest_impedance(h))) - np.log(np.abs(least_impedance(h))))
    mean = float(np.sum(0.5 * (apart[1:] + apart[:-1]) * np.diff(w)) / (high - low))
    return Width(mean, 20.0 / math.log(10.0) * mean)


class Transparency(NamedTuple):
    """Greatest error of Z_felt / Z_touched over a band and a class of environments.

    magnitude_db [dB] and phase_deg [degrees], each with the frequency [rad/s] and environment
    where it is.
    """

    magnitude_db: float
    magnitude_at: float
    magnitude_environment: Environment
    phase_deg: float
    phase_at: float
    phase_environment: Environment


def transparency_error(h: Hybrid, environment: Complexes) -> tuple[Floats, Floats]:
    """Return 20 log10 |Z_felt / Z_touched| [dB] and its phase [degrees]."""
    ratio = transmitted(h, environment) / environment
    return np.asarray(20.0 * np.log10(np.abs(ratio))), np.degrees(np.angle(ratio))


def transparency(
    response: Response,
    environments: Sequence[Environment],
    low: float,
    high: float,
    points: int = 1000,
) -> Transparency:
    """Return the greatest errors between two frequencies [rad/s] over the environments."""
    w = np.geomspace(low, high, points)
    h = response(np.asarray(1j * w))
    loud: tuple[float, float, Environment] = (-1.0, low, environments[0])
    turned = loud
    for environment in environments:
        decibels, degrees = transparency_error(h, environment.impedance(np.asarray(1j * w)))
        for values, is_phase in ((np.abs(decibels), False), (np.abs(degrees), True)):
            at = int(np.argmax(values))
            found = (float(values[at]), float(w[at]), environment)
            if is_phase:
                turned = max(turned, found, key=lambda one: one[0])
            else:
                loud = max(loud, found, key=lambda one: one[0])
    return Transparency(*loud, *turned)
