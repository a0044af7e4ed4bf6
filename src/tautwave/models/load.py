"""A load on one axis as a function of its position: a constant and a sine; SI of the axis."""

from __future__ import annotations

import math
from typing import NamedTuple


class LoadParams(NamedTuple):
    """Effort that a load exerts: `constant + cosine cos x + sine sin x` [N m or N].

    `x` is the axis' position [rad, or m: only a constant makes sense there].
    """

    constant: float
    cosine: float
    sine: float


def load_effort(p: LoadParams, x: float) -> float:
    """Return the effort of the load on the axis at position `x` [N m or N]."""
    return p.constant + p.cosine * math.cos(x) + p.sine * math.sin(x)


def load_energy(p: LoadParams, x: float) -> float:
    """Return the load's potential energy [J], whose negative slope is the effort."""
    return -p.constant * x - p.cosine * math.sin(x) + p.sine * math.cos(x)


def load_stiffness(p: LoadParams) -> float:
    """Return the greatest change of the effort per position [N m/rad]."""
    return math.hypot(p.cosine, p.sine)
