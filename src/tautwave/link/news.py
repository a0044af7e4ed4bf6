"""What a side says of itself over a network, as counters on the circle of `laws.counters`.

A packet carries whole numbers below 2**52: quanta of 2**-40 rad or m of a position, of 2**-40 rad/s
or m/s of a velocity, of 2**-40 J of all credit ever sent, and one number for an effort in quanta
of 2**-26 N m or N together with the level of a tank in 1023rds. What does not fit counts as 0.
"""

from __future__ import annotations

import math

from tautwave.laws.counters import ENERGY_QUANTUM, MASK, apart

MOTION_QUANTUM = 2.0**-40
EFFORT_QUANTUM = 2.0**-26

FURTHEST = 2000.0
"""[rad or m, rad/s or m/s] A motion beyond it is none of a device."""
STRONGEST = 32000.0
"""[N m or N]"""

LEVELS = 1023
LEVEL_BITS = 10
EFFORT_MASK = MASK >> LEVEL_BITS
EFFORT_HALF = (EFFORT_MASK + 1) >> 1


def counted(value: float, quantum: float, most: float) -> int:
    """Return the nearest number of quanta to a value, 0 for one that is not within `most`."""
    if not -most < value < most:  # NaN is not
        return 0
    return math.floor(value / quantum + 0.5)


def motion_said(value: float) -> int:
    """Return a position or velocity as a counter."""
    return counted(value, MOTION_QUANTUM, FURTHEST) & MASK


def motion_heard(counter: int) -> float:
    """Return the position or velocity that a counter stands for."""
    return apart(counter, 0) * MOTION_QUANTUM


def credit_said(energy: float) -> int:
    """Return all credit ever sent [J] as a counter, rounded down: none is invented."""
    return math.floor(energy / ENERGY_QUANTUM) & MASK


def effort_said(effort: float, level: float) -> int:
    """Return an effort [N m or N] and the level of a tank [1] as one number."""
    share = 0
    if level > 0.0:
        share = LEVELS
        if level < 1.0:
            share = math.floor(LEVELS * level)
    quanta = counted(effort, EFFORT_QUANTUM, STRONGEST) & EFFORT_MASK
    return (quanta << LEVEL_BITS) + share


def effort_heard(counter: int) -> float:
    """Return the effort that was said [N m or N]."""
    quanta = (((counter >> LEVEL_BITS) + EFFORT_HALF) & EFFORT_MASK) - EFFORT_HALF
    return quanta * EFFORT_QUANTUM


def level_heard(counter: int) -> float:
    """Return the level of a tank that was said [1]."""
    return (counter & LEVELS) / LEVELS
