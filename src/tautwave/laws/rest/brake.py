"""A motor as a brake: a spring that slips beyond its greatest effort, and a damper beside it.

The spring's far end, the anchor, stays where it is until the stretch exceeds `slip` and is dragged
along from then on, as dry friction with compliance does (Prandtl's element, the stop operator). So
a load below the greatest effort is held in place, and a hand that is stronger moves the device,
which stays where it is left.

Of the device's certain damping b spring and damper need a third each. Sampled with period T and d
whole periods late, the spring of stiffness K gives out at most K (1/2 + d) times the sum of the
squared displacements: its potential after a period is at most that of the dragged stretch, the
stretch changes by no more than the device moves, and x y <= (x^2 + y^2) / 2. The device takes at
least b/T times that sum. (Of a delay with a fraction see `lateness`.) The damper's share is
`analysis.walls.limits.greatest_damping`. What is left pays for the encoder's step and the drive's.
SI units; rotary axes read N m for N and rad for m.
"""

from __future__ import annotations

import math
from typing import NamedTuple

SHARE = 1.0 / 3.0
"""Of the device's damping, for the spring, for the damper, and for the steps of the encoder."""


class BrakeParams(NamedTuple):
    """Constants of a brake.

    stiffness [N/m]; damping [N s/m] on a velocity whose low-pass has `gain` [1]; `slip` [m], the
    greatest stretch; period [s]; `device` [N s/m], damping that the device is certain to have and
    that nothing else counts on; `quantum` [m] of the encoder. What it may give out beyond what
    the device takes: `capital` [J] each time, `power` [W] for the steps of encoder and drive, and
    `reserve` [J] once if the host stalls.
    """

    stiffness: float
    damping: float
    gain: float
    slip: float
    period: float
    device: float
    quantum: float
    capital: float
    power: float
    reserve: float


def lateness(delay: float) -> float:
    """Return the periods by which a late spring lags at most, as a motion may have it [1].

    Of a whole `delay` in periods it is m = 1/2 + d. With a fraction r the effort changes within a
    period, and a device may move more where it is the older one: with a share a of the displacement
    there, the spring gives out K (m - r + a) x^2, and the device takes
    b/T (a^2 / r + (1 - a)^2 / (1 - r)) x^2. The greatest ratio is (m + sqrt(m^2 + r (1 - r))) / 2.
    """
    mean, share = 0.5 + delay, delay - math.floor(delay)
    return 0.5 * (mean + math.sqrt(mean * mean + share * (1.0 - share)))


def passive_stiffness(device: float, period: float, delay: float) -> float:
    """Return the spring [N/m] that takes a share of damping `device` [N s/m].

    `period` [s]; `delay` in periods.
    """
    return SHARE * device / (period * lateness(delay))


def step_power(device: float, period: float, quantum: float, effort_quantum: float) -> float:
    """Return what the steps of encoder [m] and drive [N] may make a brake give out [W].

    Of n steps in a period a brake loses at most 2 n^2 + e n, and the device surely takes
    3 (n - 1)^2, in units of a third of b q^2 / T; e = 3 T f / (b q) for a drive of step f. The
    greatest difference in any period is (3 + e/2)^2 - 3.
    """
    drive = 1.5 * period * effort_quantum / device
    reach = 3.0 * quantum + drive
    return SHARE * device / period**2 * (reach * reach - 3.0 * quantum * quantum)


def drag_anchor(p: BrakeParams, anchor: float, position: float) -> float:
    """Return where the spring's far end is [m] with the device at `position` [m]."""
    stretch = position - anchor
    if stretch > p.slip:
        return position - p.slip
    if stretch < -p.slip:
        return position + p.slip
    return anchor


def brake_velocity(p: BrakeParams, velocity: float, displacement: float, count: int) -> float:
    """Return the filtered velocity [m/s] after a displacement [m] over `count` periods."""
    return velocity + p.gain * (displacement / (count * p.period) - velocity)


def brake_effort(p: BrakeParams, anchor: float, velocity: float, position: float) -> float:
    """Return the resisting effort [N], positive where the device is beyond its anchor."""
    return p.stiffness * (position - anchor) + p.damping * velocity


def device_takes(p: BrakeParams, displacement: float, count: int) -> float:
    """Return what the device surely dissipated [J] in a displacement [m] that an encoder shows.

    It moved by a step less at least, and at a constant speed it loses the least.
    """
    sure = math.fabs(displacement) - p.quantum
    return p.device * sure * sure / (count * p.period) if sure > 0.0 else 0.0
