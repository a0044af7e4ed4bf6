"""A force held for a minute against a stiff wall, and a hand that rests behind it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.rig import command_delays, end_constants
from tautwave.simulation import simulate
from tests.lab.port.hands import PERIOD
from tests.lab.port.rigs import IMPEDANCE, bench_rig, fastest
from tests.lab.port.tracking import chatter, rms

Float = npt.NDArray[np.float64]

HELD = "{type: minimum_jerk, waypoints: [[0.2, 0.0], [0.7, 0.18]]}"
WALL = "{type: wall, position: 0.08, stiffness: 250.0, damping: 5.0e-3}"
"""The hand's 3.03 N m/rad end 0.1 rad behind the wall: 0.3 N m."""

RESTING = "{type: minimum_jerk, waypoints: [[0.2, 0.0], [0.7, 0.1]]}"
NEARER = "{type: wall, position: 0.05, stiffness: 250.0, damping: 5.0e-3}"
RESTING_S = 10.0
SETTLED_S = 2.0
"""By then the hand has come to rest and the knock has died out [s]."""

EMPTY = 1e-9
"""Share of its reserve below which a tank is empty."""

BEFORE_B = 0.02
"""Impedance of the law before [N m s/rad]."""


class Held(NamedTuple):
    """What is left of a force [N m] that a hand presses.

    share: motor over line effort, and cut: share of waves that could not be paid for, both nan
    where there is no line; drift [rad] of the error between the first sixth and the last; chatter
    [N m]; error: rms [rad]; time, efforts, errors: the whole run.
    """

    effort: float
    share: float
    cut: float
    drift: float
    chatter: float
    error: float
    time: Float
    efforts: Float
    errors: Float


def held_rig(port: str, noise: float, seconds: float, *, resting: bool = False) -> Rig:
    """Return a rig that holds 0.3 N m (or rests at 0.1 rad before a wall) without dry friction."""
    return bench_rig(
        port,
        RESTING if resting else HELD,
        NEARER if resting else WALL,
        noise=noise,
        seconds=seconds,
        coulomb=0.0,
        viscous=2.0e-3,
    )


def hold(port: str, noise: float, seconds: float, *, resting: bool = False) -> Held:
    """Hold 0.3 N m (or rest at 0.1 rad before a wall) with a law, devices without dry friction."""
    rig = held_rig(port, noise, seconds, resting=resting)
    run = simulate(rig, engine=fastest(rig))
    efforts, errors = run["slave.lever.port_effort"], run["lever.position_error"]
    end = len(efforts) - round(0.3 / PERIOD)
    sixth = max((end - round(SETTLED_S / PERIOD)) // 6, 1)
    last = slice(end - sixth, end)
    first = slice(end - 6 * sixth, end - 5 * sixth)
    share = cut = math.nan
    if "slave.lever.cut_waves" in run.columns:
        cut = float(run["slave.lever.cut_waves"][end - 1]) / end
    elif "lever.port_slave.stored" in run.columns:
        reserve = end_constants(rig, "slave.lever", command_delays(rig)["slave.lever"]).port.reserve
        cut = float(np.mean(run["lever.port_slave.stored"][:end] < (EMPTY - 1.0) * reserve))
    if "slave.lever.wave_in" in run.columns:
        impedance = BEFORE_B if port == "before" else IMPEDANCE
        arriving, leaving = run["slave.lever.wave_in"][last], run["slave.lever.wave_out"][last]
        line = -math.sqrt(0.5 * impedance) * float(np.mean(arriving - leaving))
        share = float(np.mean(efforts[last])) / line
    return Held(
        effort=float(np.mean(efforts[last])),
        share=share,
        cut=cut,
        drift=float(np.mean(errors[last]) - np.mean(errors[first])),
        chatter=chatter(efforts[last]),
        error=rms(errors),
        time=PERIOD * np.arange(end, dtype=np.float64),
        efforts=efforts[:end],
        errors=errors[:end],
    )
