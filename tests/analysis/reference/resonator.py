"""The resonator behind its spring as sampled schemes render it."""

from __future__ import annotations

import math

import numpy as np

from tautwave.analysis.exact.rational import Rational, Sampled, rational
from tautwave.errors import ConfigError
from tests.lab.papers.resonator_loop import COUPLING
from tests.lab.papers.resonator_sampled import Scheme, sampled_hand, sampled_law


def sampled_controller(
    period: float, scheme: Scheme, delay: int = 0, coupling: float = COUPLING
) -> Sampled:
    """Return the sampled controller as an impedance; coefficients are rounded, then exact."""
    num, den = sampled_law(period, scheme, coupling)
    late = [*den.tolist(), *[0.0] * delay]
    return Sampled(rational(num.tolist(), late), period)


def sampled_loop(period: float, scheme: Scheme, delay: int = 0) -> Rational:
    """Return the loop transfer function L(z) at the seed's k_c, for Nyquist plots and margins."""
    num, den = sampled_law(period, scheme)
    top, bottom = sampled_hand(period)
    late = np.concatenate([np.polymul(den, bottom), np.zeros(delay)])
    return rational(np.polymul(num, top).tolist(), late.tolist())


def rendered_hz(frequency_hz: float, period: float, scheme: Scheme) -> float:
    """Return the pitch [Hz] at which a scheme rings an undamped resonance of `frequency_hz` [Hz].

    Raises
    ------
    ConfigError
        If an explicit scheme cannot run it: w T >= 2.
    """
    half = math.pi * frequency_hz * period
    if scheme in ("zoh", "foh"):
        return frequency_hz
    if scheme == "tustin":
        return math.atan(half) / (math.pi * period)
    if half >= 1.0:
        raise ConfigError(f"the explicit scheme needs w T < 2 (got {2.0 * half:.4g})")
    return math.asin(half) / (math.pi * period)


def cordis_stable(period: float, mass: float, damping: float, stiffness: float) -> bool:
    """Return whether CORDIS-ANIMA's explicit scheme can run a mass-spring-damper on its own.

    With K' = k T**2 / m and Z' = r T / m its poles are the roots of
    z**2 - (2 - K' - Z') z + (1 - Z'), inside the unit circle if and only if K' > 0, Z' > 0 and
    K' + 2 Z' < 4 (Jury's test at z = 1, at infinity and at z = -1).

    Parameters
    ----------
    period : float
        T [s].
    mass, damping, stiffness : float
        m [kg] (> 0), r [N s/m], k [N/m].
    """
    stiff, loss = stiffness * period**2 / mass, damping * period / mass
    return stiff > 0.0 and loss > 0.0 and stiff + 2.0 * loss < 4.0
