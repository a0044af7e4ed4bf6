"""A scene's numbers chosen together with the device that holds it: its modes are the ideal's.

Sampling and holding bend the modes of hand, device, coupling spring and network. The numbers of
springs and dampers are ours, so they can be others than those meant: such that the loop as it is
sampled has the modes of the loop as it is meant, without sampling. Every oscillation asks for two
numbers, and every mass has two, its spring and its damping; the device's are those of the coupling
spring.

What the numbers cannot do is make the port passive: the leak of the sampled port is stated beside
(`certificate`), and is what the device's damping has to pay.

Source: Florens 2006 (temps haptique synchrone); the equations and their solution are written here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave_scenes.models.link_kinds import is_linear
from tautwave_scenes.networks.network import Network
from tautwave_scenes.networks.sampled import linear_scene, loop_poles

Numbers = npt.NDArray[np.float64]
Modes = tuple[complex, ...]

EQUAL = 1e-9
"""Relative difference of modes below which the equations are solved."""

RUNGS = (8.0, 4.0, 2.0, 1.0)
"""The period is approached in these shares: a short one bends little, and begins the next."""

NEWTON = 20


class Held(NamedTuple):
    """Device and hand at the port [kg, N s/m, N/m]; periods until its effort acts.

    `scale` is the scene's motion per motion of the device.
    """

    mass: float
    damping: float
    stiffness: float
    delay: int = 0
    scale: float = 1.0


class Tuned(NamedTuple):
    """The network with its chosen numbers, and its modes [1/s], of a pair the one with Im > 0.

    `ideal` without sampling; `plain` sampled with the numbers as meant, `found` as chosen.
    """

    network: Network
    ideal: Modes
    plain: Modes
    found: Modes

    @property
    def error(self) -> float:
        """Greatest relative difference between a mode and the ideal."""
        return _worst(self.found, self.ideal)


def why_not(network: Network) -> str | None:
    """Return why a network's numbers cannot be chosen so, or None."""
    if len(network.ports) != 1:
        return f"it is for one port (there are {len(network.ports)})"
    if network.strings or any(not is_linear(link.kind) for link in network.links):
        return "it is for masses, springs and dampers"
    springs = [link for link in network.links if link.stiffness > 0.0]
    touching = [link for link in springs if network.ports[0] in (link.a, link.b)]
    if len(touching) != 1:
        return f"one spring has to be at the port (there are {len(touching)})"
    if len(springs) != len(network.masses) + 1:
        return (
            "every mass needs one spring of its own beside the port's: their parameters are what "
            f"is chosen ({len(network.masses)} masses, {len(springs) - 1} springs)"
        )
    return None


def tune(network: Network, scheme: str, period: float, held: Held) -> Tuned:
    """Return a network whose sampled loop with device and hand has the modes it is meant to have.

    Parameters
    ----------
    network : Network
        One for which `why_not` is None.
    scheme : str
        How it is stepped.
    period : float
        T [s].
    held : Held
        Device and hand.

    Raises
    ------
    ValueError
        There are no such numbers at this period, or none were found.
    """
    meant = _numbers(network)
    ideal = ideal_modes(network, held)
    plain = sampled_modes(network, scheme, period, held, ideal)
    scale = _scales(network)
    parameters = meant
    for rung in RUNGS:
        parameters = _solve(network, scheme, period / rung, held, ideal, parameters, scale)
    tuned = _with_numbers(network, parameters)
    return Tuned(tuned, ideal, plain, sampled_modes(tuned, scheme, period, held, ideal))


def ideal_modes(network: Network, held: Held) -> Modes:
    """Return the modes of device, hand and network in continuous time [1/s], slowest first."""
    at = {network.ports[0]: 0} | {mass.name: i for i, mass in enumerate(network.masses, 1)}
    size = len(at)
    mass = np.diag([held.mass, *(one.mass for one in network.masses)])
    stiffness, damping = np.zeros((size, size)), np.zeros((size, size))
    stiffness[0, 0], damping[0, 0] = held.stiffness, held.damping
    for i, one in enumerate(network.masses, 1):
        damping[i, i] = one.damping
    for link in network.links:
        way = np.zeros(size)
        for name, sign in ((link.a, 1.0), (link.b, -1.0)):
            if name in at:
                way[at[name]] += sign * (held.scale if at[name] == 0 else 1.0)
        stiffness += link.stiffness * np.outer(way, way)
        damping += link.damping * np.outer(way, way)
    back = np.linalg.inv(mass)
    whole = np.block([[np.zeros((size, size)), np.eye(size)], [-back @ stiffness, -back @ damping]])
    return _upper(np.linalg.eigvals(whole))


def sampled_modes(network: Network, scheme: str, period: float, held: Held, ideal: Modes) -> Modes:
    """Return the modes of the loop as it runs [1/s]: to each of `ideal` the nearest one."""
    scene = linear_scene(network, scheme, period, network.ports[0], held.scale)
    poles = loop_poles(scene, held.mass, held.damping, held.stiffness, held.delay)
    left = [complex(z) for z in poles if z.imag >= 0.0 and abs(z) > 1e-12]
    paired = []
    for mode in ideal:
        target = np.exp(mode * period)
        nearest = min(left, key=lambda z: abs(z - target))
        left.remove(nearest)
        paired.append(complex(np.log(nearest) / period))
    return tuple(paired)


def _upper(values: npt.NDArray[np.complex128]) -> Modes:
    kept = [complex(s.real, max(s.imag, 0.0)) for s in values.tolist() if s.imag > -1e-9 * abs(s)]
    return tuple(sorted(kept, key=abs))


def _worst(found: Modes, ideal: Modes) -> float:
    return max(abs(one - two) / abs(two) for one, two in zip(found, ideal, strict=True))


def _numbers(network: Network) -> Numbers:
    """Return what is chosen: every spring, the damping of the port's, every mass' damping."""
    springs = [link for link in network.links if link.stiffness > 0.0]
    at_port = next(one for one in springs if network.ports[0] in (one.a, one.b))
    return np.array(
        [
            *(link.stiffness for link in springs),
            at_port.damping,
            *(mass.damping for mass in network.masses),
        ]
    )


def _scales(network: Network) -> Numbers:
    """Return by what each number is measured: a spring by itself, a damping by root(k m)."""
    springs = [link.stiffness for link in network.links if link.stiffness > 0.0]
    masses = [mass.mass for mass in network.masses]
    like = math.sqrt(max(springs) * max(masses, default=1e-3))
    return np.array([*springs, like, *(math.sqrt(max(springs) * mass) for mass in masses)])


def _with_numbers(network: Network, numbers: Numbers) -> Network:
    given = iter(numbers.tolist())
    links = [
        link._replace(stiffness=next(given)) if link.stiffness > 0.0 else link
        for link in network.links
    ]
    damping = next(given)
    port = network.ports[0]
    links = [
        link._replace(damping=damping)
        if link.stiffness > 0.0 and port in (link.a, link.b)
        else link
        for link in links
    ]
    masses = tuple(mass._replace(damping=next(given)) for mass in network.masses)
    return network._replace(masses=masses, links=tuple(links))


def _missing(
    network: Network, scheme: str, period: float, held: Held, ideal: Modes, numbers: Numbers
) -> Numbers:
    """Return the relative differences of the modes, as real numbers: as many as are chosen."""
    tuned = _with_numbers(network, numbers)
    modes = sampled_modes(tuned, scheme, period, held, ideal)
    parts: list[float] = []
    for one, two in zip(modes, ideal, strict=True):
        gap = (one - two) / abs(two)
        parts += [gap.real, gap.imag] if two.imag > 0.0 else [gap.real]
    return np.array(parts)


def _solve(
    network: Network,
    scheme: str,
    period: float,
    held: Held,
    ideal: Modes,
    start: Numbers,
    scale: Numbers,
) -> Numbers:
    """Solve by Newton's iterations, a step halved while it makes nothing better."""

    def missing(numbers: Numbers) -> Numbers:
        if not np.all(numbers[: len(network.masses) + 1] > 0.0):
            return np.full(len(numbers), math.inf)
        return _missing(network, scheme, period, held, ideal, numbers)

    numbers = start
    gap = missing(numbers)
    for _ in range(NEWTON):
        if np.abs(gap).max() <= 0.01 * EQUAL:
            break
        slopes = np.empty((len(gap), len(numbers)))
        for at in range(len(numbers)):
            step = np.zeros(len(numbers))
            step[at] = 1e-5 * scale[at]
            slopes[:, at] = (missing(numbers + step) - missing(numbers - step)) / 2e-5
        try:
            change = np.linalg.solve(slopes, -gap) * scale
        except np.linalg.LinAlgError:
            break
        share = 1.0
        while share > 1e-3:
            tried = missing(numbers + share * change)
            if np.abs(tried).max() < np.abs(gap).max():
                break
            share *= 0.5
        else:
            break
        numbers, gap = numbers + share * change, tried
    if not np.abs(gap).max() <= EQUAL:
        raise ValueError(
            f"no spring and damper values give the loop its intended modes at {1.0 / period:.4g} "
            "Hz; raise rate_hz, or remove the key"
        )
    return numbers
