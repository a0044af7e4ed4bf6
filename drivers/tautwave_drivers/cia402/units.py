"""From a drive's counts to SI at the axis and back, by quanta that are exact for both sides.

A command is rounded by the rule of `tautwave.models.encoder.quantise` (nearest, halves up), so
`counts * quantum` is `quantise(value, quantum)` to the bit; what the loop recorded is what the
drive was sent. Efficiency of gears is not assumed: effort is transformed by power conservation
alone (torque times motor turn equals effort times travel), so friction in the gear belongs to the
axis' model.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

from tautwave.errors import ConfigError

INT16 = 32767
INT32 = 2147483647
"""Greatest counts of 16 and 32 bit targets; used for both signs, so that -1 can turn a sign."""

MILLI = 1e-3
MICRO = 1e-6
"""Unit of 6076h: mN m by CiA 402-2, uN m on a maxon EPOS4."""

MAXON = 0xFB
"""Vendor whose 6076h is in uN m."""


class AxisScale(NamedTuple):
    """Value of one count at the axis, in SI.

    `encoder_quantum` [rad or m] of 6064h and 607Ah, `velocity_quantum` [rad/s or m/s] of 606Ch and
    60FFh, `effort_quantum` [N m or N] of 6071h, 6077h and 60B2h (1/1000 of rated).
    """

    encoder_quantum: float
    velocity_quantum: float
    effort_quantum: float


def to_counts(value: float, quantum: float, limit: int) -> int:
    """Return the nearest count of `value` (halves up), saturated to +-`limit`; NaN and inf: 0."""
    count = value / quantum
    if -limit <= count <= limit:
        return math.floor(count + 0.5)
    if not math.isfinite(value):
        return 0
    return limit if count > 0.0 else -limit


def limit_counts(limit: float, quantum: float, greatest: int = INT16) -> int:
    """Return the most counts whose value does not exceed `limit` (>= 0, in the quantum's unit)."""
    if not limit >= 0.0:
        return 0
    count = limit / quantum
    if count >= greatest:
        return greatest
    whole = math.floor(count)
    if (whole + 1) * quantum <= limit:
        whole += 1
    elif whole * quantum > limit:
        whole -= 1
    return whole


class Transmission(NamedTuple):
    """From the motor shaft to the axis.

    `gear_motor` motor turns make `gear_shaft` turns of the driving shaft (6091h:01, :02);
    `feed_m` [m] is the way per `feed_revolutions` turns of it (6092h), 0 for a rotary axis.
    """

    gear_motor: int = 1
    gear_shaft: int = 1
    feed_m: float = 0.0
    feed_revolutions: int = 1

    @property
    def travel(self) -> float:
        """Travel of the axis per motor turn [rad or m]."""
        shaft = Fraction(self.gear_shaft, self.gear_motor)
        if self.feed_m > 0.0:
            return float(Fraction(self.feed_m) * shaft / self.feed_revolutions)
        return math.tau * float(shaft)


def axis_scale(
    transmission: Transmission,
    encoder_increments: int,
    rated_torque: float,
    *,
    encoder_revolutions: int = 1,
    velocity_quantum: float = 0.0,
) -> AxisScale:
    """Return the scale of an axis whose drive counts encoder increments of its motor.

    Parameters
    ----------
    transmission : Transmission
        Gear (6091h) and feed (6092h).
    encoder_increments, encoder_revolutions : int
        608Fh:01 increments (after quadrature) per 608Fh:02 motor turns.
    rated_torque : float
        [N m] 6076h at the motor shaft, converted by `MILLI` or `MICRO`.
    velocity_quantum : float
        [rad/s or m/s] of one velocity count, from one of the functions below; 0 for increments
        per second.

    Raises
    ------
    ConfigError
        A number that has to be positive is not.

    Notes
    -----
    Source: CiA 402-2 v3.0, factor group (608Fh, 6091h, 6092h) and 6076h.
    """
    positive = {
        "encoder increments (608F:01)": encoder_increments,
        "motor revolutions (608F:02)": encoder_revolutions,
        "gear, motor shaft (6091:01)": transmission.gear_motor,
        "gear, driving shaft (6091:02)": transmission.gear_shaft,
        "feed revolutions (6092:02)": transmission.feed_revolutions,
        "rated torque (6076)": rated_torque,
    }
    wrong = [
        f"{name} is {value}; it has to be above 0: read it from the drive or give it in the rig"
        for name, value in positive.items()
        if not 0 < value < math.inf
    ]
    if not 0.0 <= transmission.feed_m < math.inf:
        wrong.append(f"feed (6092:01) is {transmission.feed_m} m; 0 means a rotary axis")
    if not 0.0 <= velocity_quantum < math.inf:
        wrong.append(f"velocity quantum is {velocity_quantum}; 0 means increments per second")
    if wrong:
        raise ConfigError(wrong)
    travel = transmission.travel
    encoder_quantum = travel * encoder_revolutions / encoder_increments
    return AxisScale(
        encoder_quantum,
        velocity_quantum if velocity_quantum > 0.0 else encoder_quantum,
        rated_torque / 1000.0 * (math.tau / travel),
    )
