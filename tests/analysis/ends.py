"""Ends of a wave line with the belief of a test: by default a plain port without a filter."""

from __future__ import annotations

import numpy as np

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, Matrix, Site
from tautwave.analysis.wave_port.port_loop import wave_end
from tautwave.laws.observer import observer_params, plain_observer
from tautwave.laws.port import port_params


def site_of(
    period: float, mass: float, delay: int = 0, late: float = 0.0, *, gain: float = 1.0
) -> Site:
    """Return the belief in a device of at least `mass` [kg or kg m**2]."""
    return Site(period, 0.5 * period / mass, gain, delay, late)


def port_end(
    device: Device,
    site: Site,
    impedance: float,
    *,
    pole: float | None = None,
    matched: bool = False,
    filter_gain: float = 1.0,
) -> LinearEnd:
    """Return an end with a wave port of this impedance [N s/m or N m s/rad]."""
    period = site.period
    mass = 0.5 * period / site.half_mobility
    port = port_params(
        period,
        impedance,
        mass,
        delay=site.delay_periods + site.late_share,
        matched=matched,
        filter_gain=filter_gain,
        reserve=1.0,
    )
    seen = plain_observer(period, mass)
    if pole is not None:
        seen = observer_params(period, mass, pole)
    return wave_end(device, site, port, seen)


def spectral_radius(matrix: Matrix) -> float:
    """Return the greatest |eigenvalue| [1]."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


def reflecting_end(reflection: float) -> LinearEnd:
    """Return an end that sends back `reflection` times what arrived a slot before [1]."""
    return LinearEnd(np.zeros((1, 1)), np.ones(1), np.full(1, reflection), ("arrived",))
