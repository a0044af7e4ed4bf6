"""How well a rig shows its environment: least and greatest impedance, Z-width, what is felt.

Z_min is what the hand feels in free motion (F_s = 0), Z_max against a clamp (v_s = 0). Between
them lies what a rig can show.

Sources: Colgate & Brown, ICRA 1994 (Z-width); Hannaford 1989 (hybrid two-ports).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.two_port import Hybrid, Response

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
