"""Published rules for sampled walls that are read in steps of an encoder; each with its limits.

Source: Abbott & Okamura, "Effects of position quantization and sampling rate on virtual-wall
passivity", IEEE Trans. Robotics 21(5) 952, 2005. Energies per motion are derived here.
"""

from __future__ import annotations

import math

from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall, velocity_gain


def quantised_stiffness(damping: float, coulomb: float, period: float, quantum: float) -> float:
    """Return Abbott and Okamura's bound K <= min(2 b / T, 2 c / Q) [N/m or N m/rad].

    Necessary and sufficient for a spring read with an encoder step `quantum` [m or rad], prompt,
    on a device with viscous `damping` and `coulomb` friction [N or N m]. With a quantum and no
    Coulomb friction it is 0: no wall passes. quantum 0: the unquantised bound.
    """
    smooth = 2.0 * damping / period
    return min(smooth, 2.0 * coulomb / quantum) if quantum > 0.0 else smooth


def quantum_force(wall: SampledWall, quantum: float) -> float:
    """Return the greatest error of the wall's effort by an encoder step [N or N m].

    K Q / 2 of the spring, and of the damper |B| Q / T at once or g |B| Q / T behind a filter: a
    reading is off by at most half a step, a difference by one.
    """
    velocity = velocity_gain(wall) * velocity_quantum(quantum, wall.period)
    return 0.5 * wall.stiffness * quantum + abs(wall.damping) * velocity


def velocity_quantum(quantum: float, period: float) -> float:
    """Return the step Q / T of a differenced position [m/s or rad/s]."""
    return quantum / period


def quantum_activity(
    wall: SampledWall, damping: float, coulomb: float, quantum: float, *, needed: float = math.nan
) -> float:
    """Return a bound of the energy a quantised wall can give per two samples, any motion [J].

    Sampling takes at most b_min times the integral of v^2, which is at least dx^2 / T per sample;
    the quantum's error F takes at most F |dx|, and friction gives back c |dx|. The best stroke
    leaves T (F - c)^2 / (2 (b - b_min)). 0 if F <= c and b >= b_min; inf if b does not exceed it
    otherwise. `needed` is b_min if it is known.
    """
    if math.isnan(needed):
        needed = wall_leak(wall).damping
    surplus = quantum_force(wall, quantum) - coulomb
    if surplus <= 0.0 and damping >= needed:
        return 0.0
    if damping <= needed:
        return math.inf
    return wall.period * surplus * surplus / (2.0 * (damping - needed))
