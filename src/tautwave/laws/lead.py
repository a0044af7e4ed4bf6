"""Where a virtual hand wants to be that a program leads: first-order hold, speed, reach and range.

An action is a position to be at one frame later. The reference goes there in a straight line over
that frame, never faster than `velocity`; where the limit made it late, it goes on. It stays within
`reach` of the device, so that the hand's spring pulls with no more than stiffness times reach, and
inside the range. Source: written here.
"""

from __future__ import annotations

from typing import NamedTuple


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
