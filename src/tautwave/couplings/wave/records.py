"""Constants and state of a wave coupling: one end at each axis, the line between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from tautwave.laws.admittance import AdmittanceParams
from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams


class WaveEndParams(NamedTuple):
    """Constants of one end.

    `admittance` is the law of an axis that takes velocity, which has no observer; `wave` is device
    wave per line wave: sign * sqrt(power ratio); `quantum` the effort's step [N m or N], by which a
    command may be off without counting as cut; `late` the share of a period for which the command
    before still acts; `watch` the weight of a period in the share of cut waves [1], `limp` the
    share at which the run ends; below `empty` [J] a tank could not pay for its wave; `astray` the
    gap [W**0.5 s] that may be owed for `patience` periods without shrinking.
    """

    port: PortParams
    observer: ObserverParams
    admittance: AdmittanceParams
    wave: float
    quantum: float
    late: float
    delay: int
    watch: float
    limp: float
    empty: float
    astray: float
    patience: int


@dataclass(slots=True)
class WaveEnd:
    """State of one end: observer, tank, waves, and its books [J].

    `at`, `velocity`, `push` are observed: position [rad or m], velocity, acceleration from outside.
    `stored` is what the tank holds beyond its reserve, 0 before it was filled. `wanted` is the
    last requested effort [N m or N]; `cut_left` the periods for which an effort that limits cut
    may still act, `cut_share` the share of the last periods in which the tank could not pay for
    the whole wave; `owing` the periods for which a large gap was not below `least_gap`; `watched`
    whether any of these is at work. `wave_sum` and `wave_energy` are of the waves whose commands
    acted since the last sample. The `rate_` fields are the rate converter of a slow axis.
    """

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    account: float = 0.0
    stored: float = 0.0
    gap: float = 0.0
    filtered: float = 0.0
    wanted: float = 0.0
    cut_share: float = 0.0
    leaving: float = 0.0
    wave_in: float = 0.0
    arrived: float = 0.0
    wave_sum: float = 0.0
    wave_energy: float = 0.0
    port_absorbed: float = 0.0
    damper_dissipated: float = 0.0
    leaked: float = 0.0
    spilled: float = 0.0
    rate_held: float = 0.0
    rate_mean: float = 0.0
    rate_absorbed: float = 0.0
    rate_dissipated: float = 0.0
    rate_left: int = 0
    rate_count: int = 0
    cut_left: int = 0
    least_gap: float = 0.0
    owing: int = 0
    watched: bool = False


@dataclass(slots=True)
class WaveLink:
    """State between the ends: the energy of the waves on the line [J], and where it stands."""

    line_energy: float = 0.0
    at: int = 0
