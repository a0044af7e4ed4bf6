"""A hand that a program leads: first-order hold, speed, reach and range of where it wants to be.

An action is a position to be at one frame later. The reference goes there in a straight line over
that frame, never faster than `velocity`; where the limit made it late, it goes on. It stays within
`reach` of the device, so that the hand's spring pulls with no more than stiffness times reach, and
inside the range.

Where the hand is played by the device's own motor, `hand_effort` is its spring and damper. What it
gives to the device beyond what its reference has brought is counted, and bounded: apart from the
program's own work it is as passive as a hand that holds still. Letting go, the spring's stiffness
falls, which takes energy out; taking hold, the spring begins without strain. So neither can give
any. Source: written here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.limit import truncate
from tautwave.laws.rest.alignment import AlignParams, align_effort, gate_effort


class LeadParams(NamedTuple):
    """frame: time between actions [s]; velocity [rad/s or m/s]; reach, low, high [rad or m]."""

    frame: float
    velocity: float
    reach: float
    low: float
    high: float


def lead_step(
    p: LeadParams, reference: float, goal: float, left: float, place: float, period: float
) -> float:
    """Return the reference [rad or m] a period later.

    Parameters
    ----------
    p : LeadParams
        Limits.
    reference, goal : float
        Where it is, and where the newest action wants it [rad or m].
    left : float
        What is left of that action's frame [s]; below a period: the goal is due.
    place : float
        Where the device is [rad or m].
    period : float
        [s] One slot.
    """
    rate = (goal - reference) / max(left, period)
    rate = max(-p.velocity, min(p.velocity, rate))
    after = reference + rate * period
    after = max(place - p.reach, min(place + p.reach, after))
    return max(p.low, min(p.high, after))


class HandParams(NamedTuple):
    """Constants of a simulated hand whose effort a motor exerts.

    law: its spring, damper, greatest effort and speed, of which no push grows; step: the motor's
    greatest change of effort in a period, and quantum its step [N m or N]; release: the share of
    its grip that it loses in a period while it lets go; allowance: what it may give beyond what its
    reference brings [J], from one engagement to the next.
    """

    law: AlignParams
    step: float
    quantum: float
    release: float
    allowance: float


def hand_effort(
    p: HandParams,
    grip: float,
    reference: float,
    rate: float,
    position: float,
    velocity: float,
    given: float,
    room: tuple[float, float],
) -> float:
    """Return the effort of such a hand on its device, positive along the position.

    Parameters
    ----------
    p : HandParams
        Constants.
    grip : float
        Share of its stiffness and damping, from 1 (it leads) to 0 (it has let go).
    reference, rate : float
        Where it wants to be [rad or m], and the rate of that [rad/s or m/s].
    position, velocity : float
        Of the device [rad or m, and per s].
    given : float
        What it has given beyond what its reference brought [J], in this engagement.
    room : tuple of float
        Least and greatest effort that the motor has for it [N m or N].
    """
    wanted = grip * align_effort(p.law, reference, rate, position, velocity)
    wanted = gate_effort(p.law, wanted, velocity, given, p.allowance)
    if not math.isfinite(wanted):  # before the room: of a NaN min and max would make its end
        return 0.0
    low, high = room
    return truncate(max(low, min(high, wanted)), p.quantum)


def hand_room(
    p: HandParams, bound: float, beside: float, before: float, last: float
) -> tuple[float, float]:
    """Return the least and greatest effort that a motor has for its hand [N m or N].

    Parameters
    ----------
    p : HandParams
        Constants.
    bound : float
        Greatest effort of the motor.
    beside, before : float
        Effort of everything else now, and in the period before, along the position.
    last : float
        The hand's in the period before.
    """
    total = before + last
    low, high = max(-bound, total - p.step), min(bound, total + p.step)
    if low > high:  # the limit of the effort goes before that of its rate
        low = high = max(-bound, min(bound, total))
    return low - beside, high - beside
