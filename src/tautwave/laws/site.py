"""One axis, evaluated once per cycle: local wall, effort of the coupling, limits.

Local wall (with its passivity controller) -> the coupling's effort (predicted with the wall's
effort known) -> limits, last before the motor -> shares of coupling and wall in what is sent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.compensation import (
    NO_COMPENSATION,
    NO_INERTIA,
    CompensationParams,
    InertiaParams,
)
from tautwave.laws.limit import (
    AT_LIMIT,
    RAMPED,
    STEPPED,
    LimitParams,
    clamp,
)
from tautwave.laws.ramp import NO_STALL, StallParams
from tautwave.laws.wall import WallParams, control_wall, wall_depth, wall_effort


class SiteParams(NamedTuple):
    """Constants of one axis of a site, whatever it is coupled by.

    `period` from one sample to the next [s]; `half_mobility` = T / (2 mass lower bound), 0 without
    one; `gain` is the velocity tracker's (1: plain difference); `velocity_quantum` is the drive's
    (0: none). `compensation` of the device's friction, if it `compensates`; `inertia` that is taken
    off, if it `compensates_inertia`. `clip` and `wall_clip` are what the coupling's effort and the
    wall's are clipped at, each by itself [N m or N]; infinite: by the limits of both alone. `stall`
    bounds all of the effort for a host that stalls; up to `sure` [N m or N] that never binds. A
    device that is `still` [rad or m] or less away from a place may not have left it.
    """

    period: float
    half_mobility: float
    wall: WallParams
    limit: LimitParams
    gain: float
    velocity_quantum: float
    has_wall: bool
    compensation: CompensationParams = NO_COMPENSATION
    compensates: bool = False
    inertia: InertiaParams = NO_INERTIA
    compensates_inertia: bool = False
    clip: float = math.inf
    wall_clip: float = math.inf
    stall: StallParams = NO_STALL
    sure: float = math.inf
    still: float = 0.0


def render_wall(
    p: SiteParams,
    energy: float,
    owes: bool,
    depth: float,
    velocity: float,
    free_velocity: float,
    ceiling: float,
) -> float:
    """Return the resisting effort of the local wall of an impedance axis [N m or N].

    Parameters
    ----------
    p : SiteParams
        Constants; there is a wall.
    energy : float
        Energy absorbed by the wall since contact began, less what it owed then [J].
    owes : bool
        An effort held over a gap between samples gave energy that is not paid back yet.
    depth : float
        How deep in the wall the axis was measured, > 0 [rad or m].
    velocity : float
        Velocity filtered for the wall [rad/s or m/s].
    free_velocity : float
        Mean velocity of the coming acting period if nothing new acted [rad/s or m/s].
    ceiling : float
        Present effort ceiling of the engage ramp [N m or N].
    """
    wall = p.wall
    bound = p.limit.effort
    if ceiling < bound:
        bound = ceiling
    if wall.most < bound:
        bound = wall.most
    if p.wall_clip < math.inf:
        share = p.wall_clip * (ceiling / p.limit.effort)
        if share < bound:
            bound = share
    effort = wall_effort(wall, depth, velocity)
    if not -bound <= effort <= bound:
        effort = clamp(effort, bound)
    if wall.controlled or owes:
        return control_wall(wall, effort, energy, free_velocity, p.half_mobility, p.period)
    return effort


def clip_coupling(p: SiteParams, asked: float, ceiling: float, whole: float) -> float:
    """Return what a coupling may send of what it asks for [N m or N].

    Parameters
    ----------
    p : SiteParams
        Constants.
    asked : float
        Resisting effort that it asks for [N m or N].
    ceiling, whole : float
        Present effort ceiling of the engage ramp, and the one at its end [N m or N]: both ends of a
        pair are at the same share of it.
    """
    if not p.clip < math.inf:
        return asked
    return clamp(asked, p.clip * (ceiling / whole))


def wall_ahead(p: SiteParams, position: float, pending: float) -> tuple[float, float, float]:
    """Return push, stiffness and damping of the wall where a velocity to be chosen will act.

    `pending` is the sum of the commanded velocities that have not acted yet [rad/s or m/s]; the
    push [N m or N] is that of the spring at the start of the acting period; all 0 off the wall.
    """
    if not p.has_wall:
        return 0.0, 0.0, 0.0
    ahead = wall_depth(p.wall, position + p.period * pending)
    if not ahead > 0.0:
        return 0.0, 0.0, 0.0
    return p.wall.side * p.wall.stiffness * ahead, p.wall.stiffness, p.wall.damping


def limit_velocity(p: SiteParams, asked: float, ceiling: float) -> float:
    """Return the velocity that may be commanded [rad/s or m/s], a multiple of the drive's step."""
    bound = p.limit.velocity
    if ceiling < bound:
        bound = ceiling
    velocity = asked
    if not -bound <= asked <= bound:
        velocity = clamp(asked, bound)
    if p.velocity_quantum > 0.0:
        counts = math.floor(velocity / p.velocity_quantum + 0.5)
        # Rounding is to the nearest step, but never over the limit.
        if p.velocity_quantum * counts > bound:
            counts = counts - 1
        elif p.velocity_quantum * counts < -bound:
            counts = counts + 1
        velocity = p.velocity_quantum * counts
    return velocity


def velocity_limited(p: SiteParams, asked: float, ceiling: float, velocity: float) -> int:
    """Return why `limit_velocity` made another of what was asked for: bits of `laws.limit`."""
    bits = 0
    if not -p.limit.velocity <= asked <= p.limit.velocity:
        bits = AT_LIMIT
    if ceiling < p.limit.velocity and not -ceiling <= asked <= ceiling:
        bits += RAMPED
    if bits == 0:
        bits = STEPPED
    return bits


def held_effort(
    p: SiteParams, push: float, stiffness: float, damping: float, velocity: float
) -> float:
    """Return the wall's resisting effort in the acting period of a velocity [N m or N].

    `push`, `stiffness` and `damping` are those of `wall_ahead`.
    """
    half = 0.5 * stiffness * p.period
    return push + (damping + half) * velocity
