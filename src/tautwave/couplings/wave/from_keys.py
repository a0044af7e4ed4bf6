"""From the keys of a wave pair to the constants of its ports, SI of each device."""

from __future__ import annotations

from tautwave.contracts import PortConstants
from tautwave.couplings.wave.keys import WavePair


def port_constants(pair: WavePair, side: str) -> PortConstants:
    """Return impedance and damper of the port at one side."""
    return PortConstants(
        wave_impedance=pair.in_device_units(side, pair.wave_impedance),
        matched=pair.matched_master if side == "master" else pair.matched_slave,
    )
