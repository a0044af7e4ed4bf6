"""Values that cross the contract edges. SI units; rotary axes read N m for N and rad for m."""

from __future__ import annotations

from typing import Any, NamedTuple


class JointState(NamedTuple):
    """What a driver measured on one axis.

    `position` [rad or m]; `velocity` [rad/s or m/s] and `effort` [N m or N] are NaN where the
    device does not measure them. `effort` is the external force (hand, environment) on the device,
    positive along `position`. `valid` is False when no fresh sample came in this cycle; the numbers
    are then not to be used. `age_ns` is the time since the sample.
    """

    position: float
    velocity: float
    effort: float
    valid: bool
    age_ns: int


class AxisCommand(NamedTuple):
    """Command of one axis until the next one.

    `effort` [N m or N] is used by impedance axes, `velocity` [rad/s or m/s] by admittance axes,
    both positive along `position`; the other one is 0.
    """

    effort: float
    velocity: float


class CommandDelay(NamedTuple):
    """Time until a written command acts: whole bus periods and a remainder [s] below one."""

    periods: int
    remainder_s: float


class Fault(NamedTuple):
    """A fault that a device or a bus reported, as text. `axis` is '' for the whole bus."""

    axis: str
    text: str
    fatal: bool


SAFE_COMMAND = AxisCommand(0.0, 0.0)
"""Zero effort for an impedance axis, zero velocity for an admittance axis."""


class Choice(NamedTuple):
    """What a law takes for a key that a rig leaves to it, and why, without a full stop."""

    value: Any
    reason: str
