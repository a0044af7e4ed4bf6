"""The laws of states: what is observed, one effort for all of them, and its constants.

    R = K (x - x_far) + B (v - v_far) + D v + r d - f F - g F_far

with d all that moves the device and is not its motor (observed), F what acts on it from outside, d
less friction, or (position-force) its motor's command.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tautwave.columns import Column
from tautwave.contracts import CoupledAxis
from tautwave.controller.records import AxisParams, AxisState, PairParams
from tautwave.controller.seen import SeenEnd, seen_law
from tautwave.controller.steps import Law
from tautwave.couplings.outside import outside_effort
from tautwave.couplings.states.keys import (
    FourChannelPair,
    ObservedPair,
    PositionForcePair,
    ServoPair,
)
from tautwave.errors import ConfigError
from tautwave.laws.observer import ReactionParams, observe, reaction


class StatesEndParams(NamedTuple):
    """Constants of one end, in its device's own units.

    stiffness, damping, injection [N m/rad, N m s/rad or N/m, N s/m]; rejection, own_force,
    far_force [1]; observes, measures: external efforts are observed, or measured; else F is the
    motor's effort.
    """

    stiffness: float
    damping: float
    injection: float
    rejection: float
    own_force: float
    far_force: float
    outside: ReactionParams
    observes: bool
    measures: bool


@dataclass(slots=True)
class StatesEnd(SeenEnd):
    """What one side sees of the other, and its observer: position, velocity, acceleration."""

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0


def begin(s: AxisState) -> None:
    """Begin at rest, with nothing acting from outside."""
    e = s.end
    e.at = s.position
    e.velocity = 0.0
    e.push = 0.0


def spring(q: PairParams, p1: AxisParams, p2: AxisParams) -> float:
    """Return the slave's spring, for a master may have none, in master units [N m/rad or N/m]."""
    stiffness: float = q.weight * q.ratio * q.ratio * p2.end.stiffness
    return stiffness


def keep(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Observe what acts on the device, or take what its motor was commanded."""
    e = s.end
    k = p.end
    e.effort = port
    if k.observes:
        at, velocity, push = observe(
            k.outside.observer, e.at, e.velocity, e.push, s.position, s.effort_sum / count, count
        )
        e.at = at
        e.velocity = velocity
        e.push = push
        e.effort = reaction(k.outside, velocity, push)
    if k.measures:
        e.effort = s.outside


def effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort [N m or N]."""
    e = s.end
    k = p.end
    asked: float = k.stiffness * (s.position - e.far_position) + k.injection * s.velocity
    asked += k.damping * (s.velocity - e.far_velocity)
    if k.rejection > 0.0:
        asked += k.rejection * k.outside.mass * e.push
    asked -= k.own_force * e.effort + k.far_force * e.far_effort
    return asked


SIGNALS = (
    Column(
        "believed_effort",
        "N m, N",
        "external effort on the device, by the law's observer",
        lambda s, p: s.end.effort,
    ),
)
"""What is recorded of an axis."""


def _law(name: str, *, alike: bool = False) -> Law:
    return seen_law(
        name,
        effort,
        end=StatesEnd,
        begin=begin,
        keep=keep,
        spring=spring,
        signals=SIGNALS,
        alike=alike,
    )


position_force = _law("position_force")
pd_damping = _law("pd_damping", alike=True)
four_channel = _law("four_channel")


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
