"""One end of an observed wave pair as a linear system; SI of its device."""

from __future__ import annotations

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Site
from tautwave.analysis.wave_port.port_loop import observed_end
from tautwave.couplings.wave.from_keys import bare_port, observer_of
from tautwave.couplings.wave.keys import WavePair


def linear_end(
    pair: WavePair, side: str, device: Device, site: Site, filter_gain: float
) -> LinearEnd:
    """Return the end at one side; its waves are those of the line."""
    period = site.port.period
    mass = period / (2.0 * site.port.half_mobility)
    delay = site.delay_periods + site.late_share
    return observed_end(
        device,
        site,
        bare_port(pair, side, period, mass, delay),
        observer_of(pair, side, period, mass),
        wave_gain=pair.wave_gain(side),
    )
