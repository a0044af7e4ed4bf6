"""The scattering of an admittance port, and of a wave filter."""

from __future__ import annotations

from tautwave.analysis.exact.rational import constant
from tautwave.analysis.walls.sampled import PulseTransfer
from tautwave.laws.servo.admittance import AdmittanceParams
from tests.analysis.reference.scattering import ONE, Q, _filter, _power, _whole, as_pulse


def admittance_scattering(
    port: AdmittanceParams, delay_periods: int, stiffness: float, damping: float = 0.0
) -> PulseTransfer:
    """Return S(z) of a velocity-controlled port at an outside spring and damper.

    Parameters
    ----------
    port : AdmittanceParams
        Constants, with the upper bound of the stiffness outside.
    delay_periods : int
        Whole periods until a command acts.
    stiffness, damping : float
        True K [N/m or N m/rad] and B [N s/m or N m s/rad] that press on the force sensor.
    """
    period = _whole(port.period)
    acted = _power(Q, delay_periods + 1)
    pending = sum((_power(Q, at) for at in range(1, delay_periods + 1)), constant(0))
    outside = _whole(stiffness) * period / (ONE - Q) + _whole(damping)
    divisor = _whole(port.divisor) + outside * acted + _whole(port.stiffness) * period * pending
    return as_pulse(acted * (constant(2) * _whole(port.impedance) / divisor - ONE))


def filter_transfer(gain: float) -> PulseTransfer:
    """Return the wave filter a / (1 - (1 - a) / z), a its step; |H| <= 1 with 1 at standstill."""
    return as_pulse(_filter(gain))
