"""Constants and state of a wave coupling: one end at each axis, the line between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tautwave.laws.admittance import AdmittanceParams
from tautwave.laws.tracked_port import PortParams


class WaveEndParams(NamedTuple):
    """Constants of one end.

    `port` closes either kind of axis, `admittance` is that of one that takes velocity; `wave` is
    device wave per line wave: sign * sqrt(power ratio).
    """

    port: PortParams
    admittance: AdmittanceParams
    wave: float


@dataclass(slots=True)
class WaveEnd:
    """State of one end: its port with the energy account, its waves, and its books [J].

    `wave_sum` and `wave_energy` are of the waves whose commands acted since the last sample. The
    `rate_` fields are the rate converter of a slow axis.
    """

    predicted: float = 0.0
    account: float = 0.0
    fastest: float = 0.0
    gap: float = 0.0
    leaving: float = 0.0
    wave_in: float = 0.0
    arrived: float = 0.0
    wave_sum: float = 0.0
    wave_energy: float = 0.0
    port_absorbed: float = 0.0
    damper_dissipated: float = 0.0
    forgiven: float = 0.0
    rate_held: float = 0.0
    rate_mean: float = 0.0
    rate_absorbed: float = 0.0
    rate_dissipated: float = 0.0
    rate_left: int = 0
    rate_count: int = 0


class WaveLinkParams(NamedTuple):
    """Constants between the ends: a low-pass on the waves, if `filtered`."""

    filtered: bool
    filter_gain: float


@dataclass(slots=True)
class WaveLink:
    """State between the ends: where the line stands, its energy, and both filters."""

    line_energy: float = 0.0
    filter_master: float = 0.0
    filter_master_absorbed: float = 0.0
    filter_master_stored: float = 0.0
    filter_master_dissipated: float = 0.0
    filter_slave: float = 0.0
    filter_slave_absorbed: float = 0.0
    filter_slave_stored: float = 0.0
    filter_slave_dissipated: float = 0.0
    at: int = 0
