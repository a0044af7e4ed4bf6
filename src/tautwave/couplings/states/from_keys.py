"""From the keys of a pair of states to the constants of one end, SI of each device."""

from __future__ import annotations

from tautwave.contracts import CoupledAxis
from tautwave.couplings.outside import outside_effort
from tautwave.couplings.states.keys import (
    FourChannelPair,
    ObservedPair,
    PositionForcePair,
    ServoPair,
)
from tautwave.couplings.states.steps import StatesEndParams
from tautwave.errors import ConfigError


def force_gains(pair: ServoPair, side: str) -> tuple[float, float]:
    """Return how much of its own and of the far effort drives one side [1]."""
    if isinstance(pair, FourChannelPair):
        return pair.force_gain, pair.force_gain
    if isinstance(pair, PositionForcePair) and side == "master":
        return 0.0, pair.force_gain
    return 0.0, 0.0


def is_observed(pair: ServoPair) -> bool:
    """Return whether what moves a device and is not its motor is observed."""
    if isinstance(pair, PositionForcePair):
        return pair.effort == "observed"
    return isinstance(pair, FourChannelPair)


def is_measured(pair: ServoPair, side: str, axis: CoupledAxis) -> bool:
    """Return whether the external effort of an end is what its sensor shows.

    Raises
    ------
    ConfigError
        It has none.
    """
    if not isinstance(pair, PositionForcePair | FourChannelPair) or pair.effort != "measured":
        return False
    if isinstance(pair, PositionForcePair) and side == "master":
        return False  # its own effort goes nowhere
    if not axis.senses:
        raise ConfigError(
            f"effort: measured: the {side} has no effort_sensor; add one, or use effort: observed"
        )
    return True


def end_constants(pair: ServoPair, side: str, axis: CoupledAxis) -> StatesEndParams:
    """Return the constants of one end."""
    own, far = force_gains(pair, side)
    follows = not (isinstance(pair, PositionForcePair) and side == "master")
    corner = pair.observer_hz if isinstance(pair, ObservedPair) else 1.0
    return StatesEndParams(
        stiffness=pair.in_device_units(side, pair.gain("stiffness")) if follows else 0.0,
        damping=pair.in_device_units(side, pair.gain("damping")) if follows else 0.0,
        injection=pair.in_device_units(side, pair.injection_of[side]),
        rejection=pair.rejection if isinstance(pair, FourChannelPair) else 0.0,
        own_force=own,
        far_force=far,
        outside=outside_effort(axis, corner),
        observes=is_observed(pair),
        measures=is_measured(pair, side, axis),
    )
