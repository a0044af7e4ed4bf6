"""One end of a position pair as a linear system, for stability and predictions; SI."""

from __future__ import annotations

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site, position_end
from tautwave.couplings.position.from_keys import coupler_constants
from tautwave.couplings.position.keys import PositionPair


def linear_end(pair: PositionPair, side: str, device: Device, site: Site) -> LinearEnd:
    """Return the end at one side; it sends its position, weighed as the far side will."""
    ratio = float(pair.sign) * pair.position_scale
    far, back = ("slave", ratio) if side == "master" else ("master", 1.0 / ratio)
    here, there = coupler_constants(pair, side), coupler_constants(pair, far)
    return position_end(
        device,
        site,
        stiffness=here.stiffness,
        damping=here.damping,
        sent_stiffness=there.stiffness * back,
        sent_damping=there.damping * back,
    )
