"""What a scene's sampled linear part asks of the device at a port, and its closed contacts."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.grids import merged
from tautwave.analysis.walls.passivity import needed_damping
from tautwave.analysis.walls.sampled import PulseTransfer
from tautwave_scenes.certificate.contacts import Regime
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.sampled import LinearScene, linear_part, seen_states

Matrix = npt.NDArray[np.float64]

EXACT_ORDER = 8
"""Greatest order for which the condition is proved in integers; above, it is searched on a grid."""


class Need(NamedTuple):
    """Device damping required by a port [N s/m or N m s/rad], its frequency, proved or not."""

    damping: float
    frequency: float
    proved: bool


def closed_part(network: Network, regime: Regime) -> Network:
    """Return the linear part of a network with some contacts closed, as springs both ways.

    Strings are taken as endless: their ends echo nothing.
    """
    links = []
    for link in network.links:
        one = regime.closed.get(link.name)
        if one is not None:
            link = Link(link.name, "spring", link.a, link.b, one.stiffness, one.damping)
        links.append(link)
    endless = tuple(Mass(s.name, 0.0, damping=2.0 * s.impedance) for s in network.strings)
    masses = network.masses + endless
    return linear_part(network._replace(masses=masses, links=tuple(links), strings=()))


def needed(scene: LinearScene, delay: float) -> Need:
    """Return the damping that makes the held, sampled port passive (Colgate and Schenkel)."""
    a, b, c = seen_states(scene)
    if not len(a):
        need = needed_damping(PulseTransfer((scene.d,)), scene.period, delay)
        return Need(need.damping, need.frequency, True)
    if len(a) <= EXACT_ORDER:
        den = np.poly(a)
        num = np.poly(a - np.outer(b, c)) + (scene.d - 1.0) * den
        need = needed_damping(
            PulseTransfer(tuple(num.tolist()), tuple(den.tolist())), scene.period, delay
        )
        return Need(need.damping, need.frequency, True)
    poles = np.linalg.eigvals(a)
    if np.abs(poles).max() >= 1.0 - 1e-12:
        worst = poles[np.argmax(np.abs(poles))]
        return Need(math.inf, abs(np.angle(worst)) / (2.0 * math.pi * scene.period), False)
    grid = [np.linspace(1e-4, math.pi, 4000)]
    for pole in poles[poles.imag > 0.0]:
        width = max(-math.log(abs(pole)), 1e-9)
        grid.append(abs(np.angle(pole)) + width * np.linspace(-30.0, 30.0, 241))
    theta = merged(grid, 1e-6, math.pi)
    leak = leak_over(scene, theta, delay)
    at = int(np.argmax(leak))
    hz = float(theta[at]) / (2.0 * math.pi * scene.period)
    return Need(max(float(leak[at]), 0.0), hz, False)


def law_over(scene: LinearScene, theta: Matrix) -> npt.NDArray[np.complex128]:
    """Return effort over position at angles w T [N/m or N m/rad]."""
    a, b, c = seen_states(scene)
    if not len(a):
        return np.full(len(theta), complex(scene.d))
    vectors = [np.linalg.solve(z * np.eye(len(a)) - a, b) for z in np.exp(1j * theta)]
    return np.asarray(np.array(vectors) @ c + scene.d, np.complex128)


def leak_over(scene: LinearScene, theta: Matrix, delay: float) -> Matrix:
    """Return the device damping needed at angles w T (Colgate and Schenkel's right side)."""
    law = law_over(scene, theta) * np.exp(-1j * delay * theta)
    return np.asarray(0.5 * scene.period * (law.real - law.imag / np.tan(0.5 * theta)))


def own_radius(scene: LinearScene) -> float:
    """Return the greatest |z| of the scene by itself, including parts not linked to any port.

    A free mass has a double pole at 1, which rounding splits by some 1e-8.
    """
    return float(np.abs(np.linalg.eigvals(scene.a)).max(initial=0.0))
