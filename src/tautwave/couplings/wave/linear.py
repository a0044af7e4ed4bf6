"""One end of a wave pair as a linear system; SI of its device."""

from __future__ import annotations

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site
from tautwave.analysis.wave_port.port_loop import wave_end
from tautwave.couplings.wave.from_keys import bare_port, observer_of
from tautwave.couplings.wave.keys import WavePair


def linear_end(pair: WavePair, side: str, device: Device, site: Site) -> LinearEnd:
    """Return the end at one side; its waves are those of the line."""
    period = site.period
    mass = period / (2.0 * site.half_mobility)
    delay = site.delay_periods + site.late_share
    return wave_end(
        device,
        site,
        bare_port(pair, side, period, mass, delay),
        observer_of(pair, side, period, mass),
        wave_gain=pair.wave_gain(side),
    )
