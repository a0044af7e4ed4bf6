"""From the keys of a position pair to the constants of its coupler, SI of each device."""

from __future__ import annotations

from tautwave.contracts import PortConstants
from tautwave.couplings.position.keys import PositionPair


def port_constants(pair: PositionPair, side: str) -> PortConstants:
    """Return spring and damper as one side feels them."""
    return PortConstants(
        # Of a port that sends no wave: its account is kept all the same.
        wave_impedance=pair.in_device_units(side, 1.0),
        stiffness=pair.in_device_units(side, pair.stiffness),
        damping=pair.in_device_units(side, pair.damping),
    )
