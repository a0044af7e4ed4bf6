"""Published rules for sampled walls: delay, quantisation, friction, leaks; each with its limits.

Sources: Gil, Sanchez, Hulin, Preusche & Hirzinger, ASME JCISE 9(1) 011005, 2009; Abbott &
Okamura, "Effects of position quantization and sampling rate on virtual-wall passivity", IEEE
Trans. Robotics 21(5) 952, 2005; Diolaiti, Niemeyer, Barbagli & Salisbury, "Stability of haptic
rendering", IEEE Trans. Robotics 22(2) 256, 2006. Energies per motion are derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall, velocity_gain


def linear_rule(wall: SampledWall, damping: float) -> float:
    """Return Gil's stable K = (b + B) / (T / 2 + delay) [N/m or N m/rad]; a hint only.

    Within 5 % of the exact limit while (b + B) T / m <= 0.05 and the delay is short; use
    `tautwave.analysis.walls.stability.stable_stiffness` to decide. `damping` is the device's
    with the hand's [N s/m or N m s/rad].
    """
    return (damping + wall.damping) / (wall.period * (0.5 + wall.delay))


# -- quantisation ---------------------------------------------------------------------------------


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


# -- friction and speed ---------------------------------------------------------------------------


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


# -- leaks and cures ------------------------------------------------------------------------------


def bounce_gain(wall: SampledWall, mass: float, damping: float = 0.0) -> float:
    """Return energy out per energy in of one penetration [1].

    exp(pi (K (T / 2 + delay) - b - B) / sqrt(K m)): the hold is a negative damper.
    First order in the period over the time in contact; the mean over the sampling phase.
    """
    held = wall.stiffness * wall.period * (0.5 + wall.delay)
    return math.exp(math.pi * (held - damping - wall.damping) / math.sqrt(wall.stiffness * mass))


def penetration_leak(wall: SampledWall, mass: float, speed: float, damping: float = 0.0) -> float:
    """Return the energy one penetration at a speed creates [J]; negative where it takes."""
    return 0.5 * mass * speed * speed * (bounce_gain(wall, mass, damping) - 1.0)


def predicting_damping(wall: SampledWall) -> float:
    """Return the B that predicts the spring by half a period, K T / 2 [N s/m or N m s/rad].

    With a plain difference K (x + T v / 2) is K x + (K T / 2) v: prediction is this damper. It
    helps stability and costs passivity as any other.
    """
    return 0.5 * wall.stiffness * wall.period
