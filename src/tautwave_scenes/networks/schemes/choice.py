"""Choice of a scene's scheme at its rate: the one with the least error, found by trial.

The rate is the rig's, so only the error can be chosen. Each contact is tried on a bounce of the
masses at its ends (`models.integrator_choice`, over entry phases and neighbouring steps), the rest
on a mode at a bound of the fastest (Gershgorin). With elements other than springs, dampers and
contacts there is no trial: discrete gradients keep their energy.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

from tautwave.models.foam import FoamParams
from tautwave.models.integrators.bounds import contact_slope, greatest_depth, step_growth
from tautwave.models.integrators.choice import bounce_error, refusal, smooth_error
from tautwave.models.integrators.schemes import DISCRETE_GRADIENT, RK4, SYMPLECTIC_EULER
from tautwave.models.plant_params import PlantParams
from tautwave_scenes.models.link_kinds import LINK_KINDS, is_linear
from tautwave_scenes.networks.network import Network

MAX_EXACT = 400
"""Masses above which a dense exponential is too slow for a loop (`networks.schemes.exact`)."""

_TRIED = {
    "discrete_gradient": DISCRETE_GRADIENT,
    "rk4": RK4,
    "symplectic": SYMPLECTIC_EULER,
}


class SceneChoice(NamedTuple):
    """The choice, and its reason in a sentence."""

    scheme: str
    why: str


@functools.lru_cache(maxsize=32)
def choose_scene_scheme(network: Network, period: float, speed: float) -> SceneChoice:
    """Return the scheme with the least error at a period [s], and why.

    Parameters
    ----------
    network : Network
        As it runs.
    period : float
        T [s].
    speed : float
        Greatest impact speed [m/s].
    """
    if network.strings:
        return SceneChoice("discrete_gradient", "discrete_gradient: strings need it")
    if all(is_linear(link.kind) for link in network.links) and len(network.masses) <= MAX_EXACT:
        return SceneChoice("exact", "exact: springs and dampers only, so no error at any rate")
    kinds = {link.name: LINK_KINDS[link.kind] for link in network.links}
    others = [
        link
        for link in network.links
        if kinds[link.name].proof != "linear" and not kinds[link.name].one_way
    ]
    if others:
        why = f"discrete_gradient: {others[0].name} is a {others[0].kind} link, and it keeps energy"
        return SceneChoice("discrete_gradient", why)
    errors = {name: scheme_error(network, name, period, speed) for name in _TRIED}
    best = min(errors, key=lambda name: errors[name])
    listed = ", ".join(
        f"{name} {error:.2g}" if math.isfinite(error) else f"{name} fails"
        for name, error in errors.items()
    )
    return SceneChoice(best, f"{best}: least error of a bounce at {speed:.3g} m/s ({listed})")


def scheme_error(network: Network, name: str, period: float, speed: float) -> float:
    """Return the worst error [1] of a scheme on contacts and fastest mode; inf: unstable."""
    scheme = _TRIED[name]
    masses = {mass.name: mass.mass for mass in network.masses}
    contacts = [link for link in network.links if link.kind == "contact"]
    tried: dict[tuple[float, FoamParams], float] = {}
    slopes = {}
    for link in contacts:
        inverse = sum(1.0 / masses[end] for end in (link.a, link.b) if end in masses)
        if inverse == 0.0 or not link.stiffness > 0.0:
            continue  # between ports: nothing bounces
        plant = _body(1.0 / inverse, 0.0, 0.0)
        foam = FoamParams(link.stiffness, link.exponent, link.loss, 0.0, 1.0, 1, 0.0, scheme)
        if refusal(plant, foam, scheme, speed, period):
            return math.inf
        slopes[link.name] = contact_slope(foam, greatest_depth(plant, foam, speed, 0.0))
        if (inverse, foam) not in tried:
            tried[inverse, foam] = bounce_error(plant, foam, speed, period)
    worst = max(tried.values(), default=0.0)
    loose = _fastest(network, masses, {})
    pressed = _fastest(network, masses, slopes)
    if step_growth(scheme, pressed[0], pressed[1], 1.0, period) > 1.0 + 1e-12:
        return math.inf
    return max(worst, smooth_error(_body(1.0, *loose), scheme, speed, period))


def _body(mass: float, stiffness: float, damping: float) -> PlantParams:
    """Return a mass on a spring and a damper to ground."""
    return PlantParams(mass, damping, 0.0, 0.0, 0.0, stiffness, 0.0, 0.0, 0.0, 0.0, 1.0)


def _fastest(
    network: Network, masses: dict[str, float], contacts: dict[str, float]
) -> tuple[float, float]:
    """Return bounds of stiffness and damping over mass of any mode [1/s^2, 1/s] (Gershgorin)."""
    stiff = dict.fromkeys(masses, 0.0)
    slow = {mass.name: mass.damping / mass.mass for mass in network.masses}
    for link in network.links:
        k = contacts.get(link.name, link.stiffness if link.kind != "contact" else 0.0)
        both = 2.0 if link.a in masses and link.b in masses else 1.0
        for end in (link.a, link.b):
            if end in masses:
                stiff[end] += both * k / masses[end]
                slow[end] += both * link.damping / masses[end]
    return max(stiff.values(), default=0.0), max(slow.values(), default=0.0)
