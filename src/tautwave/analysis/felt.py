"""What a hand felt of a coupling in one simulation, how calm it was, and what the motors made."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from tautwave.analysis.fast_motion import fast_share

Floats = npt.NDArray[np.float64]
Columns = Mapping[str, Floats]

FELT = ("hand_effort_rms", "force_error_rms", "rendered_stiffness", "energy_made", "fast_share")
"""Measures of this module."""


def felt_measures(
    pair: str, columns: Columns, period: float, *, ratio: float, power: float
) -> dict[str, float]:
    """Return the measures of `FELT`, in master units, from whole rows of one simulation.

    hand_effort_rms: of what the hand does to its lever: the drag of a free device, the force of a
    contact; force_error_rms: of hand and contact together, 0 where the hand feels the contact and
    nothing else; rendered_stiffness: slope of the hand's effort over its position while the slave
    is in contact, nan where it never is; energy_made: most that both motors had given at any time;
    fast_share: of motion power above 8 Hz, of the worse side.

    Parameters
    ----------
    pair, columns, period : str, mapping, float
        Name of the pair; columns by name, shape (n,); their distance [s].
    ratio, power : float
        Slave's motion per master's, with its sign; slave's energy per pair's [1].
    """
    hand = columns[f"true.master.{pair}.hand_effort"]
    # Power is kept: an effort of the slave times its motion is that of the master times its own.
    met = columns[f"true.slave.{pair}.environment_effort"] * (ratio / power)
    made = columns[f"plant.master.{pair}.motor_work"]
    made = made + columns[f"plant.slave.{pair}.motor_work"] / power
    moved = [columns[f"true.{side}.{pair}.position"] for side in ("master", "slave")]
    return {
        "hand_effort_rms": _rms(hand),
        "force_error_rms": _rms(hand + met),
        "rendered_stiffness": slope(moved[0][met != 0.0], hand[met != 0.0]),
        "energy_made": max(0.0, float(np.max(made))),
        "fast_share": max(fast_share(each, period) for each in moved),
    }


def slope(positions: Floats, efforts: Floats) -> float:
    """Return the slope of efforts over positions by least squares; nan without any motion."""
    if len(positions) < 2:
        return math.nan
    apart = positions - np.mean(positions)
    spread = float(apart @ apart)
    return float(apart @ efforts) / spread if spread > 0.0 else math.nan


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
