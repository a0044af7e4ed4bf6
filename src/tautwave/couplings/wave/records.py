"""Constants and state of a wave coupling: one end at each axis, the line between them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams
from tautwave.laws.servo.admittance import AdmittanceParams


class WaveEndParams(NamedTuple):
    """Constants of one end.

    `admittance` is the law of an axis that takes velocity, which has no observer; `wave` is device
    wave per line wave: sign * sqrt(power ratio); `quantum` by which a command may be off without
    counting as cut, and `step` of the effort [N m or N]; `late` the share of a period for which the
    command before still acts; `window` the periods of a second, `port_starved` the share of its
    waves' energy that may be cut [1]; below `empty` [J] a tank could not pay for its wave;
    `position_debt` the gap [W**0.5 s] that may be owed for `patience` periods without shrinking.
    `coarse`: the greatest step of the effort that the port works with; `noisy`: third differences
    of the samples, squared, beyond which noise takes more than the leak gives [rad**2 or m**2].
    """

    port: PortParams
    observer: ObserverParams
    admittance: AdmittanceParams
    wave: float
    quantum: float
    step: float
    late: float
    delay: int
    window: int
    port_starved: float
    empty: float
    position_debt: float
    patience: int
    coarse: float = math.inf
    noisy: float = math.inf


@dataclass(slots=True)
class WaveEnd:
    """State of one end: observer, tank, waves, and its books [J].

    `at`, `velocity`, `push` are observed: position [rad or m], velocity, acceleration from outside;
    `smooth` is the velocity that friction resists while the end recovers. `account` is what the
    tank holds, `reserve` what it was filled with, 0 before. `wanted` is the last requested effort
    and `under_way` the sum of the port's efforts that are still to act [N m or N]; `cut_left` the
    periods for which an effort that limits cut may still act, `wanted_sum`, `cut_sum`, `gap_sum` of
    the second that is watched, of which `watch_left` periods are left: squares of the waves and
    what of them was not paid, and the gap; `cut_before`, `gap_before` of the second before; `owing`
    the periods for which a large gap was not below `least_gap`; `watched` whether any of these is
    at work, and `third_sum`, `third_count` the third differences of the samples meanwhile, from the
    last displacements `moved`, `moved_before`. `repeats`: slots without a sample in which the last
    wave may leave again. `wave_sum` and `wave_energy` are of the waves whose commands acted since
    the last sample. The `rate_` fields are the rate converter of a slow axis.
    """

    at: float = 0.0
    velocity: float = 0.0
    push: float = 0.0
    smooth: float = 0.0
    account: float = 0.0
    reserve: float = 0.0
    gap: float = 0.0
    filtered: float = 0.0
    wanted: float = 0.0
    under_way: float = 0.0
    wanted_sum: float = 0.0
    cut_sum: float = 0.0
    gap_sum: float = 0.0
    gap_before: float = 0.0
    leaving: float = 0.0
    repeats: float = 0.0
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
    moved: float = 0.0
    moved_before: float = 0.0
    third_sum: float = 0.0
    third_count: int = 0
    steady: int = 0
    least_gap: float = 0.0
    owing: int = 0
    watch_left: int = 0
    cut_before: bool = False
    watched: bool = False


@dataclass(slots=True)
class WaveLink:
    """State between the ends: the energy of the waves on the line [J], and where it stands."""

    line_energy: float = 0.0
    at: int = 0
