"""One end of a wave pair as a linear system, for stability and predictions; SI of its device."""

from __future__ import annotations

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site, wave_end
from tautwave.couplings.tracked.keys import WavePair


def linear_end(
    pair: WavePair, side: str, device: Device, site: Site, filter_gain: float
) -> LinearEnd:
    """Return the end at one side; its waves are those of the line, filtered as they leave."""
    return wave_end(device, site, wave_gain=pair.wave_gain(side), filter_gain=filter_gain)
