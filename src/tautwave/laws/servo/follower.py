"""A device that takes positions: a goal that moves as commanded, and a spring to the device.

The port is at the goal x, a number, which reaches every commanded velocity within the period. Its
effort is that of a spring k between the goal and where the device was measured, y: F = k (y - x).
So the port is that of `tautwave.laws.servo.admittance` with Kh = k, and what has to be assumed
there, a drive that follows at once, is so. The device is outside, at the spring's end, and what
follows holds of any whose answer to its goal rises without overshoot: y = H x with an impulse
response h_j >= 0 [1 a sample], sum h_j <= 1 (less than 1: something holds it), and of a mean lag
sum j h_j T <= L. With q = 1/z the port's divisor is then

    D = b + e - j c k T / 2 - k T sum_j h_j q**(d+j+1) / (1 - q),

since k (1 - H) is the stiffness in front of the goal. Re(-q**(n+1) / (1 - q)) >= 1/2 - n for every
whole n >= 0, so the sum is at least -k sum_j h_j T (d + j - 1/2) >= -k (T max(0, d - 1/2) + L).
The extra damping e = k (T max(0, d - 1/2) + L) therefore makes Re D >= b: no more of a wave returns
than arrives, whatever the device touches. The lag feels like that anyway: at a constant velocity v
the spring is stretched by L v. A device that overshoots its goal, or lags by more than L, is not
covered.

The goal stays within `lead` of the device, so the spring never says more than k lead, and inside
the range of the axis. There it moves less than commanded; the books count what it moved. What the
device does to what it touches is nowhere in this: nobody measures it.

Source: derived here.
"""

from __future__ import annotations

from typing import NamedTuple


class FollowerParams(NamedTuple):
    """period T [s]; stiffness k [N m/rad or N/m]; lead, low, high [rad or m]."""

    period: float
    stiffness: float
    lead: float
    low: float
    high: float


def next_goal(p: FollowerParams, goal: float, velocity: float, place: float) -> float:
    """Return the goal [rad or m] after a period at `velocity`, the device being at `place`."""
    ahead = goal + velocity * p.period
    ahead = max(place - p.lead, min(place + p.lead, ahead))
    # Where a device begins beyond its range, nothing but a command inwards moves it.
    if ahead > p.high:
        return max(p.high, min(goal, ahead))
    if ahead < p.low:
        return min(p.low, max(goal, ahead))
    return ahead


def goal_effort(p: FollowerParams, goal: float, place: float) -> float:
    """Return the effort of the spring on the goal [N m or N], positive along the axis."""
    return p.stiffness * (place - goal)


def lag_damping(stiffness: float, lag: float) -> float:
    """Return the damping that covers a device of this mean lag [s], beyond that of the delay."""
    return stiffness * lag
