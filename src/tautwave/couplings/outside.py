"""From what a rig says of an axis to the constants of what observes its outside effort; SI."""

from __future__ import annotations

import math

from tautwave.contracts import CoupledAxis
from tautwave.laws.observer import ReactionParams, observer_params

STILL = 1e-3
"""Least velocity at which Coulomb friction is believed to be in full [rad/s or m/s]."""

SLOWEST = 0.99
"""Greatest pole: a memory of a hundred periods."""


def outside_effort(axis: CoupledAxis, corner: float) -> ReactionParams:
    """Return the constants of an observer of external efforts.

    Parameters
    ----------
    axis : CoupledAxis
        An axis that takes effort; inertia and friction are the best estimates.
    corner : float
        Bandwidth [Hz].
    """
    mass = axis.inertia if axis.mass is None else axis.mass
    assert mass is not None
    pole = min(SLOWEST, math.exp(-2.0 * math.pi * corner * axis.period))
    # within the noise friction has no sign
    noise = max(axis.position_noise, axis.encoder_quantum) / axis.period
    soft = max((1.0 - pole) * noise, STILL)
    observer = observer_params(axis.period, mass, pole)
    return ReactionParams(observer, mass, axis.viscous, axis.coulomb, soft)
