"""From the keys of a wave pair to the constants of its ports and its line, SI of each device."""

from __future__ import annotations

from tautwave.contracts import CoupledAxis
from tautwave.couplings.tracked.keys import WaveCoupling, WavePair
from tautwave.couplings.tracked.records import WaveEndParams, WaveLinkParams
from tautwave.laws.admittance import admittance_params
from tautwave.laws.tracked_port import port_params, rigid_port, sensor_allowance


def port_impedance(pair: WavePair, side: str) -> float:
    """Return the wave impedance of the port at one side [N m s/rad or N s/m]."""
    return pair.in_device_units(side, pair.wave_impedance)


def end_constants(pair: WavePair, side: str, axis: CoupledAxis) -> WaveEndParams:
    """Return the constants of one end."""
    period, impedance = axis.period, port_impedance(pair, side)
    allowance = sensor_allowance(
        period, impedance, axis.gain, axis.encoder_quantum, axis.position_noise
    )
    if axis.inertia is not None:
        matched = pair.matched_master if side == "master" else pair.matched_slave
        port = port_params(period, impedance, axis.inertia, matched, pair.drift_time_s, allowance)
    else:
        port = rigid_port(period, impedance, pair.drift_time_s, allowance)
    admittance = admittance_params(period, impedance, axis.outside_stiffness, axis.delay)
    return WaveEndParams(port, admittance, pair.wave_gain(side))


def link_constants(coupling: WaveCoupling, period: float) -> WaveLinkParams:
    """Return the constants of what lies between the ends, in slots of `period` [s]."""
    step = coupling.filter_step(period)
    return WaveLinkParams(step != 1.0, step)
