"""Hands that move the bench: recordings, or multisines where there are none.

Recordings are CSV, MAT or MCAP files of a one-degree-of-freedom bench, `SET_CONTROLLER_CONTACT`,
with a time and the positions of both levers. Those of the TU/e robotics lab
(Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments, MIT) are not part of the project.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError
from tautwave.motion import recorded_positions
from tautwave.recordings.columns import column_names, read_columns
from tautwave.recordings.times import time_columns

Float = npt.NDArray[np.float64]

PERIOD = 0.5e-3
LEAD_S = 1.0
"""Time in which a hand goes from zero to where its recording begins [s]."""

CONTACTS = ("free", "foam", "spring", "rigid")
FORMATS = (".csv", ".mat", ".mcap")
_NAMED = re.compile(r"(?:^|[^a-z])(free|foam|spring|rigid)(?:motion)?(?=[^a-z]|$)")
_POSITION = re.compile(r"position|angle")
_DEGREES = re.compile(r"(^|[^a-z])deg(rees)?([^a-z]|$)")

EVERY_S = 0.01
"""Between the samples by which it is seen which lever the hand moves [s]."""

SLOW = 0.02
"""Velocity from which on dry friction is believed to act in full [rad/s]."""

SURE = 4.0
"""Standard deviations by which a lever has to trail the other."""

SYNTHETIC_S = 5.0
MIN_S = 1.5
"""Shortest recording: half a second at its start and 0.3 s at its end are left out."""


class Hand(NamedTuple):
    """Positions [rad] of a hand, one every `PERIOD` after its lead.

    recorded: what the laboratory's far lever was off meanwhile [rad]; None for synthetic hands.
    """

    name: str
    contact: str
    positions: Float
    recorded: Float | None

    @property
    def seconds(self) -> float:
        """Duration with the lead [s]."""
        return LEAD_S + len(self.positions) * PERIOD

    def write(self, folder: Path) -> Path:
        """Write the hand as a CSV file that a rig can play; return its path."""
        share = np.linspace(0.0, 1.0, round(LEAD_S / PERIOD), endpoint=False)
        lead = self.positions[0] * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
        values = np.concatenate([lead, self.positions])
        path = folder / f"{self.name}.csv"
        rows = np.column_stack([PERIOD * np.arange(len(values)), values])
        np.savetxt(path, rows, delimiter=",", header="time_s,hand", comments="", fmt="%.8g")
        return path


def recorded_hands(folder: Path, seconds: float = math.inf) -> list[Hand]:
    """Return the hands recorded in a folder, at most `seconds` of each.

    Raises
    ------
    ConfigError
        The folder has none, or a file lacks a column.
    """
    found = []
    for path in sorted(it for it in folder.iterdir() if it.suffix.lower() in FORMATS):
        name, _, _ = path.stem.partition(".")
        contact = _NAMED.findall(name.lower())
        if not contact:
            continue
        names = column_names(path)
        master, slave = (_lever(path, names, side) for side in ("master", "slave"))
        clock = next(iter(time_columns(names)), "time_s")
        read = read_columns(path, [master, slave], clock)
        times = read[clock]
        whole = float(times[-1] - times[0])
        if whole < MIN_S:
            raise ConfigError(f"{path}: has {whole:.3g} s; a hand needs {MIN_S:g} s at least")
        new = np.arange(0.0, min(whole, seconds) + 0.5 * PERIOD, PERIOD)
        moved, far = (
            _radians(each) * recorded_positions(times, read[each], new, False)
            for each in (master, slave)
        )
        if trails(moved, far):
            moved, far = far, moved
        found.append(Hand(name, contact[-1], moved, moved - far))
    if not found:
        raise ConfigError(
            f"{folder}: has no recording; their names end in "
            f"{', '.join(f'_{each}' for each in CONTACTS)} and {', '.join(FORMATS)}"
        )
    return found


def _lever(path: Path, names: Sequence[str], side: str) -> str:
    """Return the column with the position of a side's lever."""
    able = [it for it in names if side in it.lower() and _POSITION.search(it.lower())]
    if f"{side}_position_rad" in able:
        return f"{side}_position_rad"
    if len(able) != 1:
        raise ConfigError(
            f"{path}: there is no one column for the {side}'s lever, whose name has {side} and "
            f"position or angle in it; available: {', '.join(names) or 'none, the file is empty'}"
        )
    return able[0]


def _radians(name: str) -> float:
    """Return the rad in the unit that a column has by its name."""
    return math.pi / 180.0 if _DEGREES.search(name.lower()) else 1.0


def trails(one: Float, other: Float) -> bool:
    """Return whether one lever [rad] is dragged along by the other: it trails by dry friction.

    Of the difference of both what goes with the place is a spring's, what goes with the sign of the
    velocity is friction, which only the hand's lever has the other's share of.
    """
    every = round(EVERY_S / PERIOD)
    apart, middle = (other - one)[::every], 0.5 * (one + other)[::every]
    speed = np.gradient(middle, every * PERIOD)
    parts = np.column_stack([np.ones_like(middle), middle, speed / (np.abs(speed) + SLOW)])
    found, *_ = np.linalg.lstsq(parts, apart, rcond=None)
    left = apart - parts @ found
    spread = math.sqrt(float(np.var(left) * np.linalg.pinv(parts.T @ parts)[2, 2]))
    return bool(found[2] > SURE * spread)


def synthetic_hands(seconds: float = SYNTHETIC_S) -> list[Hand]:
    """Return a multisine hand for each contact, always the same."""
    time = PERIOD * np.arange(round(seconds / PERIOD))
    hands = []
    for at, contact in enumerate(CONTACTS):
        rng = np.random.default_rng(at)
        pitch = np.array([0.5, 1.1, 2.3, 3.9]) * rng.uniform(0.9, 1.1, 4)
        angle = 2.0 * math.pi * np.outer(time, pitch) + rng.uniform(0.0, 2.0 * math.pi, 4)
        moved = np.sin(angle) @ np.array([0.06, 0.03, 0.015, 0.006])
        hands.append(Hand(f"multisine_{contact}", contact, moved, None))
    return hands
