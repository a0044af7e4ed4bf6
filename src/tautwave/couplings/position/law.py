"""Law position: spring and damper between what both sides see; its steps, and their constants."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.contracts import CoupledAxis
from tautwave.controller.records import AxisParams, AxisState, PairParams
from tautwave.controller.seen import seen_law
from tautwave.couplings.position.keys import PositionPair
from tautwave.laws.coupler import coupler_effort


class PositionEndParams(NamedTuple):
    """Spring [N m/rad or N/m] and damper [N m s/rad or N s/m] as one side feels them."""

    stiffness: float
    damping: float


def spring(q: PairParams, p1: AxisParams, p2: AxisParams) -> float:
    """Return the spring as the master feels it [N m/rad or N/m]."""
    stiffness: float = p1.end.stiffness
    return stiffness


def effort(s: AxisState, p: AxisParams, free_velocity: float) -> float:
    """Return the resisting effort of spring and damper [N m or N]."""
    e = s.end
    k = p.end
    return coupler_effort(
        k.stiffness, k.damping, s.position, s.velocity, e.far_position, e.far_velocity
    )


law = seen_law("position", effort, spring=spring, alike=True)


def coupler_constants(pair: PositionPair, side: str) -> PositionEndParams:
    """Return spring and damper as one side feels them."""
    return PositionEndParams(
        stiffness=pair.in_device_units(side, pair.stiffness),
        damping=pair.in_device_units(side, pair.damping),
    )


def end_constants(pair: PositionPair, side: str, axis: CoupledAxis) -> PositionEndParams:
    """Return the constants of one end; they are the same on any axis."""
    return coupler_constants(pair, side)
