"""A held force over minutes and hours: the compiled bench in pieces, none of which is kept."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.errors import ConfigError, SafetyStop
from tautwave.registry import load_coupling, load_named
from tautwave.rig import command_delays, end_constants
from tautwave.simulation import simulate_pieces
from tests.lab.port.hands import PERIOD
from tests.lab.port.hold import EMPTY, SETTLED_S, held_rig
from tests.lab.port.rigs import IMPEDANCE, SETTING
from tests.lab.port.tracking import chatter

Tell = Callable[[str], None]

PIECE_S = 10.0
SHOWN_S = (60.0, 600.0)
NOISES = {9e-5: 15.0, 1.5e-5: 5.0}
"""Encoder noise [rad], and the most chatter that a held force may have [mN m]."""

SIDES = ("master", "slave")


class Lasting(NamedTuple):
    """A held force after a time.

    effort of the slave [N m], share: motor over line effort, and error [rad], each the mean of the
    last `PIECE_S`; drift: of the error since the first [rad]; chatter: the greatest of them [N m];
    tank: the least that either held, over its reserve [1]; given: the most that an end gave out,
    over its claim [1].
    """

    seconds: float
    effort: float
    share: float
    error: float
    drift: float
    chatter: float
    tank: float
    given: float


def lasting(noise: float, seconds: float, engine: str = "compiled") -> list[Lasting]:
    """Hold 0.3 N m with encoder noise [rad] for so long; return how it stands every `PIECE_S`.

    Raises
    ------
    SafetyStop
        The coupling was lost.
    """
    rig = held_rig("after", noise, seconds + PIECE_S)  # ends with a release, which is left out
    delays = command_delays(rig)
    names = [f"{side}.lever" for side in SIDES]
    reserve = min(end_constants(rig, name, delays[name]).port.reserve for name in names)
    claimed_joules = load_named(load_coupling(rig.coupling.law).claim)
    claim = min(claimed_joules(rig, name, delays) for name in names)
    found: list[Lasting] = []
    start, rough, tank, given = math.nan, 0.0, math.inf, -math.inf
    for run in simulate_pieces(rig, round(PIECE_S / PERIOD), engine=engine):
        if run.error is not None:
            raise SafetyStop(f"a force held under noise of {noise:g} rad: {run.error}")
        seen = slice(0 if found else round(SETTLED_S / PERIOD), None)
        efforts, errors = run["slave.lever.port_effort"][seen], run["lever.position_error"][seen]
        waves = run["slave.lever.wave_in"][seen] - run["slave.lever.wave_out"][seen]
        effort, error = float(np.mean(efforts)), float(np.mean(errors))
        share = effort / (-math.sqrt(0.5 * IMPEDANCE) * float(np.mean(waves)))
        start = start if found else error
        rough = max(rough, chatter(efforts))
        for side in SIDES:
            tank = min(tank, 1.0 + float(run[f"lever.port_{side}.stored"][seen].min()) / reserve)
            given = max(given, -float(run[f"lever.port_{side}.absorbed"].min()) / claim)
        at = (len(found) + 1) * PIECE_S
        found.append(Lasting(at, effort, share, error, error - start, rough, tank, given))
        if at + 0.5 * PIECE_S > seconds:
            break
    return found


def holding(*, seconds: float, tell: Tell) -> Suite:
    """Hold a force for so long [s], with both of the bench's noises.

    Raises
    ------
    ConfigError
        There is no numba.
    """
    if not has_numba():
        raise ConfigError(f"a hold of {seconds:g} s is simulated compiled: {NO_NUMBA}")
    rows: list[list[Value]] = []
    goals = []
    for noise, most in NOISES.items():
        tell(f"{seconds:g} s of a held force, compiled, noise {noise:g} rad")
        found = lasting(noise, seconds)
        last = found[-1]
        rows += [
            [
                noise,
                at.seconds,
                -1e3 * at.effort,
                at.share - 1.0,
                1e3 * at.drift,
                1e3 * at.chatter,
                at.tank,
                at.given,
            ]
            for at in found
            if at.seconds in SHOWN_S or at is last
        ]
        worst = max(abs(at.share - 1.0) for at in found)
        goals += [
            Goal(f"motor over line effort at {noise:g} rad, off by", 0.005, "of 1", worst),
            Goal(f"drift at {noise:g} rad", 0.1, "mrad", 1e3 * max(abs(at.drift) for at in found)),
            Goal(f"chatter at {noise:g} rad", most, "mN m", 1e3 * last.chatter),
            Goal(f"a tank at {noise:g} rad, at least", EMPTY, "of full", last.tank, at_least=True),
            Goal(f"given out at {noise:g} rad", 1.0, "of the claim", last.given),
        ]
    table = Table(
        "0.3 N m pressed against 250 N m/rad, devices without dry friction, compiled",
        f"over the last {PIECE_S:g} s before each time: effort of the slave, motor over line "
        "effort less 1; since the start: drift of the error, the most of the slave's motor above "
        "20 Hz, the least in a tank over its reserve (where it is empty, waves are cut), the most "
        f"given out over the claim of the whole run; {SETTING}",
        ("noise_rad", "after_s", "effort_mNm", "share_off", "drift_mrad", "chatter_mNm",
         "least_in_tank", "given_of_claim"),
        rows,
    )  # fmt: skip
    return Suite("port", [table], goals)
