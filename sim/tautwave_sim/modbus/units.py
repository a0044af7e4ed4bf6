"""What one count of a drive's registers is worth at its axis."""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.truth import AxisModel
from tautwave_sim.modbus.options import DeviceKeys
from tautwave_sim.modbus.table import Table

_SAME = 1e-9
_TURNS_PER_SECOND = {"rpm": 1.0 / 60.0, "decirpm": 0.1 / 60.0}


class Scale(NamedTuple):
    """SI per count at the axis: position, velocity and effort; -1 where it counts against it."""

    position: float
    velocity: float
    effort: float
    direction: int


def drive_scale(
    device: DeviceKeys, table: Table, rated_torque: float, kind: str, truth: AxisModel
) -> Scale:
    """Return the scale of a drive on a `rotary` or `linear` axis; torque passes without loss.

    Where the truth names the same step but for the last digits, it is the truth's: the simulated
    encoder has exactly one count per step then.
    """
    travel = math.tau if kind == "rotary" or device.feed is None else device.feed
    counts = device.counts_per_revolution or table.counts_per_revolution
    position = travel / (counts * device.gear_ratio)
    unit = table.scale["velocity"]
    if unit == "counts":
        velocity = position
    else:
        turns = _TURNS_PER_SECOND[unit] if isinstance(unit, str) else float(unit)
        velocity = turns * travel / device.gear_ratio
    step = table.scale.get("effort_nm", rated_torque * float(table.scale["effort"]))
    if "effort_a" in table.scale:
        step = table.scale["effort_a"] * (device.torque_constant or 1.0)
    effort = float(step) * device.gear_ratio * (math.tau / travel)
    if "effort_n" in table.scale:  # of a linear motor
        effort = float(table.scale["effort_n"]) * device.gear_ratio
    return Scale(
        _agreed(position, truth.encoder_quantum),
        _agreed(velocity, truth.velocity_quantum),
        _agreed(effort, truth.effort_quantum),
        device.direction,
    )


def _agreed(own: float, truth: float) -> float:
    return truth if math.fabs(truth - own) <= _SAME * own else own


def to_counts(value: float, quantum: float) -> int:
    """Return the nearest count, halves up."""
    return math.floor(value / quantum + 0.5)
