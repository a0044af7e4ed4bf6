"""The operator's hand as a mass that rides on the device, held by a spring and a damper."""

from __future__ import annotations

from typing import NamedTuple


class Hand(NamedTuple):
    """Mass [kg or kg m2], damping and stiffness of a grip, in SI of the axis."""

    mass: float
    damping: float
    stiffness: float


PAPER_HAND = Hand(0.143, 5.0, 538.0)
"""Stylus grip at about 9 N, linear SI (Kuchenbecker, Park, Niemeyer 2003, as used by Berdahl et
al.): 9.76 Hz, damping ratio 0.285."""


def rotary_hand(mass: float, damping: float, stiffness: float, lever_arm: float) -> Hand:
    """Equivalent of a linear hand at `lever_arm` [m] from a rotary axis; lever arm 1 keeps it."""
    square = lever_arm * lever_arm
    return Hand(mass * square, damping * square, stiffness * square)
