"""From a rig's `simulation.integrator` to the scheme and sub-steps of one axis."""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

from tautwave.config import Integrator
from tautwave.errors import ConfigError
from tautwave.models.foam import FoamParams
from tautwave.models.integrators.choice import (
    MAX_SUBSTEPS,
    Trial,
    choose_scheme,
    refusal,
    try_scheme,
)
from tautwave.models.integrators.schemes import EXACT, SCHEMES
from tautwave.models.plant_params import PlantParams

DEFAULT_ERROR = 1e-4
_NAMES = {number: name for name, number in SCHEMES.items()}


class Integrated(NamedTuple):
    """How one axis is integrated: contact with scheme and sub-steps (None for `exact`), and why."""

    foam: FoamParams | None
    scheme: str
    why: str


@functools.lru_cache(maxsize=64)
def integrated(
    axis_name: str,
    keys: Integrator,
    plant: PlantParams,
    foam: FoamParams | None,
    speed: float,
    period: float,
) -> Integrated:
    """Return how an impedance axis is integrated.

    Parameters
    ----------
    axis_name : str
        For messages.
    keys : Integrator
        The rig's block.
    plant, foam
        The truth of the axis; `foam` is None if it touches only walls and springs.
    speed : float
        Greatest speed expected [m/s or rad/s].
    period : float
        [s] Period of the axis' exchanges.

    Raises
    ------
    ConfigError
        The scheme has no form for this contact, or cannot hold it at this step.
    """
    linear = foam is None
    contact = foam
    if contact is None:
        contact = FoamParams(
            plant.wall_stiffness,
            1.0,
            0.0,
            plant.wall_position,
            plant.wall_side,
            1,
            plant.wall_damping,
        )
    error = keys.max_error
    if keys.scheme == "auto":
        choice = choose_scheme(plant, contact, speed, period, error or DEFAULT_ERROR, linear)
        if not choice.best.error <= (error or DEFAULT_ERROR):
            raise ConfigError(f"simulation.integrator: {axis_name}: {choice.why}")
        return _with(foam, contact, choice.best, f"auto: {choice.why}")
    scheme = SCHEMES[keys.scheme]
    if scheme == EXACT:
        if not linear:
            raise ConfigError(
                f"simulation.integrator: {axis_name} meets foam, whose force is a power of the "
                "depth, but exact handles walls and springs only; use "
                "discrete_gradient, or auto"
            )
        return Integrated(None, "exact", "exact, as specified")
    if error is None and keys.scheme != "dormand_prince":
        reason = refusal(plant, contact, scheme, speed, period)
        if reason:
            raise ConfigError(
                f"simulation.integrator: {axis_name}: {reason}. Use discrete_gradient or auto, or "
                "give max_error, which divides the step"
            )
        return _with(foam, contact, Trial(scheme, 1, 0.0, math.nan, 0.0), "as specified")
    error = error or DEFAULT_ERROR
    trial = try_scheme(plant, contact, scheme, speed, period, error, math.inf)
    if not trial.error <= error:
        lost = math.isinf(trial.error)
        best = "does not resolve the contact" if lost else f"has {trial.error:.2g}"
        raise ConfigError(
            f"simulation.integrator: {axis_name}: {keys.scheme} {best} with {trial.substeps} "
            f"sub-steps of {1e6 * period / trial.substeps:.3g} us, of at most {MAX_SUBSTEPS}, and "
            f"max_error is {error:g}; use auto, or a greater max_error"
        )
    return _with(foam, contact, trial, f"worst error {trial.error:.2g} <= {error:g}")


def _with(foam: FoamParams | None, contact: FoamParams, trial: Trial, why: str) -> Integrated:
    name = _NAMES[trial.scheme]
    if trial.scheme == EXACT:
        return Integrated(foam, name, why)
    made = contact._replace(scheme=trial.scheme, substeps=trial.substeps, tolerance=trial.tolerance)
    return Integrated(made, name, why)
