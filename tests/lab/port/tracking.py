"""How far the slave is off while a hand moves the master, and what its motors do meanwhile."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import SafetyStop
from tautwave.simulation import simulate
from tests.lab.port.hands import CONTACTS, LEAD_S, PERIOD, Hand
from tests.lab.port.rigs import CONTACTS as MET
from tests.lab.port.rigs import GRIP, IMPOSED, LAWS, bench_rig, fastest

Float = npt.NDArray[np.float64]
Tell = Callable[[str], None]

ABOVE_HZ = 20.0
SETTLED_S, RELEASED_S = 0.5, 0.3
"""Left out of every figure: at the start, after the hand's lead, and at the end [s]."""


class Score(NamedTuple):
    """rms of master minus slave [rad], and of both motors' efforts above 20 Hz [N m].

    share: error over that of the laboratory's own recording, nan without one.
    """

    error: float
    chatter: float
    share: float = math.nan


def rms(values: Float) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def chatter(values: Float) -> float:
    """Return the rms of what is above 20 Hz."""
    parts = np.fft.rfft(values - np.mean(values))
    parts[np.fft.rfftfreq(len(values), PERIOD) < ABOVE_HZ] = 0.0
    return rms(np.fft.irfft(parts, len(values)))


def score(hand: Hand, port: str, noise: float, folder: Path, grip: str = GRIP) -> Score:
    """Let a hand move the bench with a law.

    Raises
    ------
    SafetyStop
        The run ended early.
    """
    reference = f"{{type: recording, file: {hand.write(folder)}, column: hand, repeat: false}}"
    rig = bench_rig(
        port, reference, MET[hand.contact], noise=noise, seconds=hand.seconds, grip=grip
    )
    run = simulate(rig, engine=fastest(rig))
    if run.error is not None:
        raise SafetyStop(f"{hand.name}, {port}: {run.error}")
    count = len(hand.positions) - round((SETTLED_S + RELEASED_S) / PERIOD)
    began = round((LEAD_S + SETTLED_S) / PERIOD)
    part = slice(began, began + count)
    error = rms(run["lever.position_error"][part])
    efforts = [chatter(run[f"{side}.lever.port_effort"][part]) for side in ("master", "slave")]
    share = math.nan
    if hand.recorded is not None:
        first = round(SETTLED_S / PERIOD)
        share = error / rms(hand.recorded[first : first + count])
    return Score(error, rms(np.array(efforts)), share)


def gripped(
    hands: Sequence[Hand], noise: float, folder: Path, tell: Tell
) -> dict[str, dict[str, Score]]:
    """Return, per contact and law, the scores of all hands together, through a soft grip."""
    found: dict[str, dict[str, Score]] = {}
    for contact in CONTACTS:
        met = [hand for hand in hands if hand.contact == contact]
        if not met:
            continue
        tell(f"hands through a grip, {contact}, noise {noise:g} rad")
        found[contact] = {}
        for port in LAWS:
            scores = [score(hand, port, noise, folder) for hand in met]
            found[contact][port] = Score(
                rms(np.array([each.error for each in scores])),
                rms(np.array([each.chatter for each in scores])),
            )
    return found


def imposed(
    hands: Sequence[Hand], folder: Path, tell: Tell, laws: Collection[str] = LAWS
) -> dict[str, dict[str, Score]]:
    """Return, per hand and law, the scores with the master's motion imposed, without noise."""
    found = {}
    for hand in hands:
        tell(f"imposed motion, {hand.name}")
        found[hand.name] = {port: score(hand, port, 0.0, folder, IMPOSED) for port in laws}
    return found
