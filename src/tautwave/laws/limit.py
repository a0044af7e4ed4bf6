"""Limits: the last functions before a motor. NaN never passes.

`share_effort` assigns the remaining effort to the wave port, so that clipping happens inside the
port's account and needs no separate one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

RUNAWAY = 4
RUNAWAY_TIMES = 1e6
"""A scene whose requested effort exceeds the axis' limit by this factor, or is NaN, is unstable.
The guard reports it as `RUNAWAY`, a code after those of `guard_axis`."""

OVERDRAWN = 5
"""The guard's code for a scene whose held efforts have created more than its allowance."""

NOT_A_NUMBER = 6
"""The guard's code for a coupling whose effort is not finite."""

UNSEEN = 7
"""The guard's code for an axis that had no sample for too long, skipped slots included."""

CLIPPED = 1
"""What the coupling asked for was cut at its share of the axis; a bit of what limits a command."""

AT_LIMIT = 2
"""The axis' effort limit, of an axis that takes velocities its velocity limit; a bit."""

RATE_LIMITED = 4
"""The effort rate limit; a bit."""

STEPPED = 8
"""The drive's steps of effort or velocity; a bit."""

RAMPED = 16
"""The ceiling of the engage or release ramp, or one that was tuned; a bit."""

STOPPED = 32
"""A stop, which acts in place of coupling and wall; a bit."""

STALL_BOUND = 64
"""What an effort may give if it is held through a stall of the host (`laws.ramp`); a bit."""


class LimitParams(NamedTuple):
    """Limits of an axis; an absent one is infinite.

    effort [N m or N], effort change per period, effort quantum (0: none), velocity
    [rad/s or m/s], position range [rad or m], damping of the stop outside it [N m s/rad or N s/m].
    """

    effort: float = math.inf
    effort_step: float = math.inf
    effort_quantum: float = 0.0
    velocity: float = math.inf
    position_low: float = -math.inf
    position_high: float = math.inf
    stop_damping: float = 0.0


NO_LIMITS = LimitParams()


def clamp(value: float, bound: float) -> float:
    """Return `value` within +-`bound`; NaN gives 0."""
    if -bound <= value <= bound:
        return value
    if value > bound:
        return bound
    if value < -bound:
        return -bound
    return 0.0  # NaN: every comparison above was False


def effort_bound(p: LimitParams, ceiling: float) -> float:
    """Return the greatest effort now: the axis' limit or the engage ramp's ceiling [N m or N]."""
    if ceiling < p.effort:
        return ceiling
    return p.effort


def rising_bound(
    p: LimitParams,
    asked: float,
    last: float,
    moved: float,
    along: float,
    half_mobility: float,
    ceiling: float,
) -> float:
    """Return the greatest effort while the engage ramp's ceiling rises [N m or N].

    The ceiling is for what pushes. An effort that resists may exceed it, or a device that engages
    in front of a loaded spring is thrown: it may be as large as stops the device in the period in
    which it acts, and what it grew to may stay. Resisting is both, against the velocity and against
    the way since the pair engaged: a velocity alone is as often noise.

    Parameters
    ----------
    p : LimitParams
        Limits of the axis.
    asked, last : float
        Resisting efforts requested and sent last [N m or N].
    moved : float
        Way since the pair engaged, beyond what noise and steps feign, else 0 [rad or m].
    along : float
        Mean velocity in the period in which the effort acts, without it [rad/s or m/s].
    half_mobility : float
        T / (2 m), m the lower bound of the inertia [s/kg or s/(kg m**2)].
    ceiling : float
        The ramp's [N m or N].
    """
    if not asked * moved > 0.0:
        return ceiling
    bound = ceiling
    if last * asked > 0.0:
        kept = math.fabs(last)
        if kept > bound:
            bound = kept
    if along * asked > 0.0:
        stops = math.fabs(along)
        if stops > half_mobility * p.effort:
            return p.effort
        stops = stops / half_mobility
        if stops > bound:
            bound = stops
    return bound


def slew(value: float, last: float, step: float) -> float:
    """Return `value` where it is within `step` of `last`, else as near to it as a step allows."""
    rise = value - last
    if rise > step:
        return last + step
    if rise < -step:
        return last - step
    return value


def limit_effort(p: LimitParams, asked: float, last: float, ceiling: float) -> float:
    """Return the resisting effort that may be sent [N m or N].

    Order: NaN to zero and the effort limit or the engage ramp's `ceiling`, whichever is lower;
    then the rate limit from `last`; then truncation to the drive's quantum, towards zero.
    """
    bound = p.effort
    if ceiling < bound:
        bound = ceiling
    value = asked
    if not -bound <= asked <= bound:
        value = clamp(asked, bound)
    if not -p.effort_step <= value - last <= p.effort_step:
        value = slew(value, last, p.effort_step)
    if p.effort_quantum > 0.0:
        return truncate(value, p.effort_quantum)
    return value


def limited_by(p: LimitParams, asked: float, last: float, ceiling: float) -> int:
    """Return which limits `limit_effort` meets, at or beyond them: a sum of the bits above."""
    bits = 0
    value = clamp(asked, effort_bound(p, ceiling))
    if not -p.effort < asked < p.effort:
        bits = AT_LIMIT
    if value != asked and ceiling < p.effort:
        bits += RAMPED
    slewed = slew(value, last, p.effort_step)
    if slewed != value:
        bits += RATE_LIMITED
    if truncate(slewed, p.effort_quantum) != slewed:
        bits += STEPPED
    return bits


def truncate(value: float, quantum: float) -> float:
    """Return the greatest multiple of `quantum` not beyond `value`, towards zero; 0: `value`.

    Never larger than the value, so a limited effort stays limited, and idempotent to the bit.
    """
    if not quantum > 0.0:
        return value
    size = math.fabs(value)
    count = size / quantum
    if not count < 4.0e15:  # no digits are left to truncate
        return value
    whole = float(math.floor(count))
    # Dividing rounds: a value that is a multiple already must not lose a quantum, nor gain one.
    if (whole + 1.0) * quantum <= size:
        whole = whole + 1.0
    elif whole * quantum > size:
        whole = whole - 1.0
    if value < 0.0:
        return -(whole * quantum)
    return whole * quantum


def share_effort(wall: float, port: float, applied: float) -> float:
    """Return the part of the `applied` effort that counts as the port's [N m or N].

    Out of the wall everything is the port's. In it, a shortfall first brings a port that pushes
    with the wall to zero, then the wall, so that a port that pulls gives no more than it planned;
    an excess (rate limit on release) is the port's.
    """
    if wall == 0.0:
        return applied
    side = 1.0
    if wall < 0.0:
        side = -1.0
    share = side * port
    short = side * (applied - wall - port)
    if short >= 0.0:
        return applied - wall
    if share > 0.0:
        share = share + short
        if share < 0.0:
            share = 0.0
    if side * applied > share:
        return side * share
    return applied  # nothing is left for the wall, which never pulls


def guard_axis(p: LimitParams, position: float, velocity: float) -> int:
    """Return 0 within limits, 1 outside the position range, 2 too fast, 3 not finite."""
    if position - position != 0.0 or velocity - velocity != 0.0:
        return 3  # NaN or infinite, which an absent limit would let pass
    if not p.position_low <= position <= p.position_high:
        return 1
    if not -p.velocity <= velocity <= p.velocity:
        return 2
    return 0


def stop_effort(p: LimitParams, velocity: float) -> float:
    """Return the resisting effort of the certified damping used while stopping [N m or N]."""
    return p.stop_damping * velocity
