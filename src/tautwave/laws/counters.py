"""Wave integral and energy as integers on a circle: exact for any length of a session.

A counter counts quanta of 2**-40, of root(W) s or of J, modulo 2**52: so it is exact in a double
as well, and never full. Only differences mean anything, and those are right up to 2048 root(W) s
or J either way.

A wave u over a period T carries T u in the integral and T u**2 / 2 in energy. Where u is rounded to
n quanta, its energy is n**2 q**2 / (2 T), not a whole number of quanta: what is credited is
rounded down, what is charged up, and both carry the fraction on, so that a sum of a million is as
exact as one. `MARGIN` covers the rounding of the five operations on the way: credit <= energy <=
charge holds in exact arithmetic, of every sum.
"""

from __future__ import annotations

import math

SPAN = 1 << 52
"""Where a counter begins again."""
MASK = SPAN - 1
HALF = SPAN >> 1

WAVE_QUANTUM = 2.0**-40
"""Of the wave integral [W**0.5 s]: 3e-12 rad at b = 0.05 N m s/rad."""
ENERGY_QUANTUM = 2.0**-40
"""Of energy [J]: 1 W for a second is 1e12 of it."""

MARGIN = 2.0**-49


def added(counter: int, change: int) -> int:
    """Return a counter after a change of less than half the circle [quanta]."""
    return (counter + change) & MASK


def apart(counter: int, other: int) -> int:
    """Return by how much a counter is ahead of another [quanta]."""
    return ((counter - other + HALF) & MASK) - HALF


def energy_scale(period: float) -> float:
    """Return energy quanta per square of a wave's quanta in a period T [s]."""
    return WAVE_QUANTUM * WAVE_QUANTUM / (2.0 * period * ENERGY_QUANTUM)


def credited(energy: float, fraction: float) -> tuple[int, float]:
    """Round energy down [quanta], and carry the fraction of a quantum that is not credited yet."""
    total = energy * (1.0 - MARGIN) + fraction
    whole = math.floor(total)
    return whole, total - whole


def charged(energy: float, prepaid: float) -> tuple[int, float]:
    """Round energy up [quanta], and carry the fraction of a quantum that is paid ahead."""
    total = energy * (1.0 + MARGIN) - prepaid
    whole = math.ceil(total)
    return whole, whole - total


def rounded_wave(wave: float, period: float, residue: float) -> tuple[int, float]:
    """Return the quanta that stand for a wave [W**0.5] over T [s], and what they leave over."""
    total = wave * period / WAVE_QUANTUM + residue
    whole = math.floor(total + 0.5)
    return whole, total - whole
