"""From the keys of a position pair to the constants of its coupler, SI of each device."""

from __future__ import annotations

from tautwave.contracts import CoupledAxis
from tautwave.couplings.position.keys import PositionPair
from tautwave.couplings.position.steps import PositionEndParams


def coupler_constants(pair: PositionPair, side: str) -> PositionEndParams:
    """Return spring and damper as one side feels them."""
    return PositionEndParams(
        stiffness=pair.in_device_units(side, pair.stiffness),
        damping=pair.in_device_units(side, pair.damping),
    )


def end_constants(pair: PositionPair, side: str, axis: CoupledAxis) -> PositionEndParams:
    """Return the constants of one end; they are the same on any axis."""
    return coupler_constants(pair, side)
