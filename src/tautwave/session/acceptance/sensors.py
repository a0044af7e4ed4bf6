"""An effort sensor against the motor before anything is coupled: offset at rest, then the scale.

Without motor effort a device that stands still balances what it touches by its friction alone: that
bounds the offset, and says nothing of the scale. The scale takes two efforts of the motor that
something holds.
"""

from __future__ import annotations

import math
from collections.abc import Generator, Sequence
from typing import NamedTuple

import numpy as np

from tautwave.analysis.identification.sensor_balance import (
    DEVIATIONS,
    Rests,
    most_at_rest,
    sensor_balance,
)
from tautwave.config import Rig
from tautwave.session.acceptance.document import Check
from tautwave.session.guided.control import GuidedControl

SECONDS = 0.2


class Rest(NamedTuple):
    """What a sensor showed [N m or N], give or take `doubt`, while the motor held `motor`."""

    shown: float
    doubt: float
    motor: float


def rest(values: Sequence[float], motor: float, quantum: float) -> Rest:
    """Return what a sensor showed of a device that stood still."""
    spread = DEVIATIONS * float(np.std(values)) / math.sqrt(len(values))
    return Rest(float(np.mean(values)), spread + 0.5 * quantum, motor)


def rest_now(
    rig: Rig, name: str, motor: float, control: GuidedControl
) -> Generator[None, None, list[Rest]]:
    """Look for a while; return one rest, none of an axis without a sensor."""
    sensor = rig.axes[name].effort_sensor
    if sensor is None:
        return []
    values: list[float] = []
    until = control.now_ns + 1e9 * SECONDS
    while control.now_ns < until or not values:
        values.append(control.outside(name))
        yield
    return [rest(values, motor, sensor.quantum)]


def sensor_checks(rig: Rig, name: str, stage: str, rests: Sequence[Rest]) -> list[Check]:
    """Return what the rests say of a sensor's scale, if anything; if it may be 1, of its offset."""
    if not rests:
        return []
    axis = rig.axes[name]
    believed = 0.0 if axis.coulomb is None else axis.coulomb.value
    friction = most_at_rest(believed, axis.effort_limit)
    columns = (np.array(column) for column in zip(*rests, strict=True))
    balance = sensor_balance(Rests(*columns), friction)
    if balance is None:
        numbers: dict[str, float | str] = {"friction": friction}
        return [Check(stage, f"{name} sensor", numbers, "an offset and a scale for all", False)]
    (low, high), (least, most) = balance.offset, balance.scale
    checks = []
    if math.isfinite(most):
        numbers = {"scale_from": least, "scale_to": most}
        good = 1.0 in balance.scale
        checks.append(Check(stage, f"{name} sensor scale", numbers, "1 in between", good))
    if 1.0 in balance.scale:
        numbers = {"offset_from": low, "offset_to": high}
        good = 0.0 in balance.offset
        checks.append(Check(stage, f"{name} sensor offset", numbers, "0 in between", good))
    return checks
