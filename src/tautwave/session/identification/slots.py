"""A recorded excitation, slot by slot: what was measured, what was sent, what is filled in."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.config import Rig
from tautwave.errors import RecordingError
from tautwave.rig.arms import load_reserves


class Slots(NamedTuple):
    """Of one axis in every slot: position [rad or m], effort [N m or N], whether it was measured.

    The effort is all that the motor got, what carries a load included.
    """

    position: NDArray[np.float64]
    effort: NDArray[np.float64]
    known: NDArray[np.bool_]


def axis_slots(path: Path, name: str, rig: Rig) -> Slots:
    """Return an axis of a recording on the grid of slots.

    Raises
    ------
    RecordingError
        Almost no sample is valid.
    """
    from tautwave.recordings.recording import read_recording

    leaves = ("position", "commanded", "valid")
    carried = [f"load.{name}.effort"] if name in load_reserves(rig) else []
    recording = read_recording(path, ["time_s", *(f"{name}.{leaf}" for leaf in leaves), *carried])
    slots = np.rint(recording.time_s * rig.rate_hz).astype(np.int64)
    slots -= slots[0]
    valid = recording[f"{name}.valid"] > 0.5
    every = np.arange(slots[-1] + 1)
    known = np.zeros(len(every), dtype=bool)
    known[slots[valid]] = True
    if np.count_nonzero(valid) < 2:
        raise RecordingError(f"{path}: {name} has almost no valid samples")
    position = np.interp(every, slots[valid], recording[f"{name}.position"][valid])
    # A command stays until the next one, over slots that were skipped too.
    held = np.searchsorted(slots, every, side="right") - 1
    effort = recording[f"{name}.commanded"]
    for column in carried:
        effort = effort + recording[column]
    return Slots(position, effort[held], known)
