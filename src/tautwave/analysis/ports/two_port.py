"""Two-port of a whole rig: hybrid matrix and Llewellyn's absolute stability.

    [F_m; -v_s] = H [v_m; F_s]    F_m: hand on master, F_s: environment on slave, v_s into it

A rig is absolutely stable if it is stable with every passive hand and environment that do not
know of each other (Llewellyn 1952): no poles of h11, h22 to the right, and along the axis

    Re h11 >= 0,  Re h22 >= 0,  2 Re h11 Re h22 - Re(h12 h21) - |h12 h21| >= 0.

Whether H sees the hold is the matter of who makes it: `tautwave.analysis.ports.sampled_port`.

Sources: Llewellyn, Proc. IRE 40, 1952; Hannaford, IEEE T-RA 5, 1989 (hybrid form). SI of each
device.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


class Hybrid(NamedTuple):
    """H at an array of points s: arrays of its shape; h11 impedance, h22 admittance."""

    h11: Complexes
    h12: Complexes
    h21: Complexes
    h22: Complexes


Response = Callable[[Complexes], Hybrid]


def llewellyn(
    h: Hybrid, sizes: tuple[float, float] = (math.inf, math.inf)
) -> tuple[Floats, Floats]:
    """Return eta - 1, and its share of what it is the difference of; digits kept towards s = 0.

    `sizes` are typical magnitudes of h11 and h22: near a pole they are far larger, and so is the
    rounding.
    """
    p = -h.h12 * h.h21
    size = np.maximum(np.abs(p), 1e-300)
    gain = 2.0 * h.h11.real * h.h22.real / size
    # 1 - Re p / |p|, where p points forwards without the difference.
    forward = p.imag**2 / np.maximum(size * (size + p.real), 1e-300)
    turned = np.where(p.real > 0.0, forward, 1.0 - p.real / size)
    excess = gain - turned
    near = (1.0 + np.abs(h.h11) / sizes[0]) * (1.0 + np.abs(h.h22) / sizes[1])
    noise = NOISE * (1.0 + np.abs(h.h11 * h.h22) / size) * near
    whole = np.maximum(np.abs(gain) + turned, 1e-300)
    return np.asarray(excess), np.where(np.abs(excess) <= noise, 0.0, excess / whole)


NOISE = 1e-13
"""Rounding of eta where it is 1 for a lossless rig."""


class Ends(NamedTuple):
    """A passive hand and environment: mass, damping, stiffness of each; SI."""

    hand: tuple[float, float, float]
    environment: tuple[float, float, float]


def destabilising_ends(response: Response, frequency: float, share: float = 0.5) -> Ends | None:
    """Return a hand and an environment that a rig which fails Llewellyn makes unstable.

    The environment is the lossless one that turns the master's resistance most negative at
    `frequency` [rad/s]; the hand resonates there with `share` of the damping it would need. None
    where no lossless environment makes it negative.
    """
    s = np.array([1j * frequency])
    h = response(s)
    conductance = float(h.h22.real[0])
    cross = complex((h.h12 * h.h21)[0])
    if conductance <= 0.0:
        turned, best = 0.0, complex(h.h11[0])
    else:
        # 1 / (h22 + j B) runs along a circle; the best point is opposite to h12 h21.
        turn = cross.conjugate() / abs(cross)
        turned = (2.0 * conductance / (1.0 + turn)).imag - float(h.h22.imag[0])
        best = complex(h.h11[0]) - cross * (1.0 + turn) / (2.0 * conductance)
    if best.real >= 0.0:
        return None
    mass = -1.0 / (frequency * turned) if turned < 0.0 else 0.0
    stiffness = frequency / turned if turned > 0.0 else 0.0

    def seen(x: complex) -> complex:
        at = response(np.array([x]))
        load = x * mass + stiffness / x
        total = at.h11 - at.h12 * at.h21 * load / (1.0 + at.h22 * load)
        return complex(total[0])

    step = 1e-6 * frequency
    slope = (seen(1j * (frequency + step)) - seen(1j * (frequency - step))) / (2j * step)
    own = max(4.0 * abs(slope), 4.0 * abs(best.imag) / frequency, 1e-3)
    spring = (own * frequency + best.imag) * frequency
    return Ends((own, -share * best.real, spring), (mass, 0.0, stiffness))
