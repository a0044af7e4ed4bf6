"""Rules of thumb for walls, and the motions that show what they leave out.

Sources: Gil, Sanchez, Hulin, Preusche & Hirzinger, ASME JCISE 9(1) 011005, 2009; Diolaiti,
Niemeyer, Barbagli & Salisbury, "Stability of haptic rendering", IEEE Trans. Robotics 22(2) 256,
2006.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.analysis.walls.rules import velocity_quantum
from tautwave.analysis.walls.sampled import SampledWall, velocity_gain


def damper_step(wall: SampledWall, quantum: float) -> float:
    """Return by how much the damper's effort jumps when the encoder counts once [N or N m]."""
    return abs(wall.damping) * velocity_gain(wall) * velocity_quantum(quantum, wall.period)


def adversarial_energy(
    stiffness: float, damping: float, coulomb: float, period: float, quantum: float, stroke: float
) -> float:
    """Return what a user gets from a quantised spring per two samples [J], at most.

    The user moves to and fro by `stroke` [m or rad] around encoder edges, once per sample at
    constant speed: K n Q d - 2 c d - 2 b d^2 / T, n the edges within the stroke. Below one step
    n is 1. Negative: the motion costs more than it gains.
    """
    edges = math.floor(stroke / quantum) + 1
    viscous = 2.0 * damping * stroke * stroke / period
    return stiffness * edges * quantum * stroke - 2.0 * coulomb * stroke - viscous


def best_stroke(
    stiffness: float, damping: float, coulomb: float, period: float, quantum: float
) -> float:
    """Return the stroke within one encoder step that gains most, T (K Q - 2 c) / (4 b) at most Q.

    0 if none gains anything [m or rad].
    """
    surplus = stiffness * quantum - 2.0 * coulomb
    if surplus <= 0.0:
        return 0.0
    if damping == 0.0:
        return quantum
    return min(period * surplus / (4.0 * damping), quantum)


def adversarial_positions(edge: float, stroke: float, samples: int) -> list[float]:
    """Return the positions at the samples of the motion of `adversarial_energy`; starts below.

    `edge` [m or rad] is where the encoder's reading changes: half a step beside a multiple of it.
    """
    half = 0.5 * stroke
    return [edge - half if k % 2 == 0 else edge + half for k in range(samples)]


class Region(NamedTuple):
    """Where Diolaiti's plane puts a wall.

    beta = b / (K T), sigma = c / (K Q), lag = delay / T, all [1]; `name` is passive,
    passive_above, stable_below or none. `speed` [m/s or rad/s] is the one above or below which
    the energy balance of a sample is on the safe side; 0 or inf where there is no such speed.
    """

    beta: float
    sigma: float
    lag: float
    name: str
    speed: float


def friction_region(wall: SampledWall, damping: float, coulomb: float, quantum: float) -> Region:
    """Return the region of a spring's (viscous, Coulomb) friction; the wall's B is left out.

    Per sample at speed v the wall gives at most T [K (T/2 + delay) v^2 + K Q v / 2 - b v^2 - c v].
    """
    lagged = wall.stiffness * wall.period * (0.5 + wall.delay)
    surplus = 0.5 * wall.stiffness * quantum - coulomb
    viscous_fine = damping >= lagged
    coulomb_fine = surplus <= 0.0
    per_sample = wall.stiffness * wall.period
    beta = damping / per_sample if per_sample > 0.0 else math.inf
    step = wall.stiffness * quantum
    sigma = coulomb / step if step > 0.0 else math.inf
    if viscous_fine and coulomb_fine:
        return Region(beta, sigma, wall.delay, "passive", 0.0)
    if viscous_fine:
        speed = surplus / (damping - lagged) if damping > lagged else math.inf
        return Region(beta, sigma, wall.delay, "passive_above", speed)
    if coulomb_fine:
        speed = -surplus / (lagged - damping)
        return Region(beta, sigma, wall.delay, "stable_below", speed)
    return Region(beta, sigma, wall.delay, "none", 0.0)


def swing_threshold(wall: SampledWall, damping: float, coulomb: float) -> float:
    """Return the speed amplitude below which Coulomb friction stops an oscillation [m/s or rad/s].

    Describing function of a sinusoid without quantisation: 4 c / (pi (K (T/2 + delay) - b)); inf
    if the viscous friction suffices.
    """
    lagged = wall.stiffness * wall.period * (0.5 + wall.delay) - damping
    return 4.0 * coulomb / (math.pi * lagged) if lagged > 0.0 else math.inf


def quantiser_gain(amplitude: float, quantum: float) -> float:
    """Return the describing function of rounding to `quantum` for a sine [1]; at most 4 / pi."""
    total = 0.0
    for i in range(1, math.floor(amplitude / quantum + 0.5) + 1):
        ratio = (2 * i - 1) * quantum / (2.0 * amplitude)
        if ratio < 1.0:
            total += math.sqrt(1.0 - ratio * ratio)
    return 4.0 * quantum / (math.pi * amplitude) * total


def penetration_leak(wall: SampledWall, mass: float, speed: float, damping: float = 0.0) -> float:
    """Return the energy one penetration at a speed creates [J]; negative where it takes."""
    return 0.5 * mass * speed * speed * (bounce_gain(wall, mass, damping) - 1.0)


def predicting_damping(wall: SampledWall) -> float:
    """Return the B that predicts the spring by half a period, K T / 2 [N s/m or N m s/rad].

    With a plain difference K (x + T v / 2) is K x + (K T / 2) v: prediction is this damper. It
    helps stability and costs passivity as any other.
    """
    return 0.5 * wall.stiffness * wall.period


def linear_rule(wall: SampledWall, damping: float) -> float:
    """Return Gil's stable K = (b + B) / (T / 2 + delay) [N/m or N m/rad]; a hint only.

    Within 5 % of the exact limit while (b + B) T / m <= 0.05 and the delay is short; use
    `tautwave.analysis.walls.stability.stable_stiffness` to decide. `damping` is the device's
    with the hand's [N s/m or N m s/rad].
    """
    return (damping + wall.damping) / (wall.period * (0.5 + wall.delay))


def bounce_gain(wall: SampledWall, mass: float, damping: float = 0.0) -> float:
    """Return energy out per energy in of one penetration [1].

    exp(pi (K (T / 2 + delay) - b - B) / sqrt(K m)): the hold is a negative damper.
    First order in the period over the time in contact; the mean over the sampling phase.
    """
    held = wall.stiffness * wall.period * (0.5 + wall.delay)
    return math.exp(math.pi * (held - damping - wall.damping) / math.sqrt(wall.stiffness * mass))
