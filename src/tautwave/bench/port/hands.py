"""Hands that move the bench: recordings, or multisines where there are none.

Recordings are CSV files of a one-degree-of-freedom bench, `<set>_<what the slave meets>.csv`, with
the columns `time_s`, `master_position_rad` and `slave_position_rad`. Those of the TU/e robotics lab
(Ohara124c41/Haptics-Bilateral_Teleoperation-1DOF_Experiments, MIT) are not part of the project.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.errors import ConfigError
from tautwave.motion import recorded_positions
from tautwave.recordings.columns import read_column

Float = npt.NDArray[np.float64]

PERIOD = 0.5e-3
LEAD_S = 1.0
"""Time in which a hand goes from zero to where its recording begins [s]."""

CONTACTS = ("free", "foam", "spring", "rigid")
FILES = {"free_motion": "free", "foam": "foam", "spring": "spring", "rigid": "rigid"}
SWAPPED = ("m1_a", "m1_b", "m1_c")
"""Sets in which the hand is on the lever that is logged as slave."""

SYNTHETIC_S = 5.0
LEAST_S = 1.5
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
    for path in sorted(folder.glob("*.csv")):
        name, _, _ = path.stem.partition(".")
        ending = [each for each in FILES if name.endswith(f"_{each}")]
        if not ending:
            continue
        master, slave = "master_position_rad", "slave_position_rad"
        if name.removesuffix(f"_{ending[0]}") in SWAPPED:
            master, slave = slave, master
        (times, moved), (_, far) = (read_column(path, each, "time_s") for each in (master, slave))
        whole = float(times[-1] - times[0])
        if whole < LEAST_S:
            raise ConfigError(f"{path}: has {whole:.3g} s; a hand needs {LEAST_S:g} s at least")
        new = np.arange(0.0, min(whole, seconds) + 0.5 * PERIOD, PERIOD)
        moved, far = (recorded_positions(times, each, new, False) for each in (moved, far))
        found.append(Hand(name, FILES[ending[0]], moved, moved - far))
    if not found:
        raise ConfigError(
            f"{folder}: has no recording; their names end in "
            f"{', '.join(f'_{each}.csv' for each in FILES)}"
        )
    return found


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
