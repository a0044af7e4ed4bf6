"""One end of the coupling, thought through once a cycle: wave port, local wall, limits.

Arriving wave -> local wall (with its passivity controller) -> port effort (predicted with the
wall's effort known) -> limits, last before the motor -> shares of port and wall in what is sent.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.admittance import AdmittanceParams, admittance_velocity
from tautwave.laws.coupler import coupler_effort
from tautwave.laws.limit import LimitParams, clamp, effort_bound, limit_effort, share_effort
from tautwave.laws.port import PortParams, port_effort
from tautwave.laws.wall import WallParams, control_wall, wall_depth, wall_effort


class SiteParams(NamedTuple):
    """Constants of one axis of a site.

    `gain` is the velocity tracker's (1: plain difference); `stiffness`, `damping` are those of a
    position coupling (0 with the wave law); `velocity_quantum` is the drive's (0: none);
    `injection` [N m s/rad or N s/m] damps a position coupling's device against ground.
    """

    port: PortParams
    admittance: AdmittanceParams
    wall: WallParams
    limit: LimitParams
    gain: float
    stiffness: float
    damping: float
    velocity_quantum: float
    has_wall: bool
    injection: float = 0.0


def think_wave(
    p: SiteParams,
    account: float,
    wall_energy: float,
    position: float,
    velocity: float,
    wall_velocity: float,
    impulse: float,
    pending: float,
    arriving: float,
    last: float,
    ceiling: float,
) -> tuple[float, float, float, float, float]:
    """Return what an impedance axis shall do until the next cycle.

    Parameters
    ----------
    p : SiteParams
        Constants.
    account : float
        Energy account of the port [J].
    wall_energy : float
        Energy absorbed by the wall since contact began [J].
    position : float
        Measured position [rad or m].
    velocity, wall_velocity : float
        Mean velocity over the last period, tracked for the port and filtered for the wall.
    impulse : float
        Sum of the resisting efforts that acted since the last but one sample [N m or N].
    pending : float
        Sum of the resisting efforts sent that have not acted yet [N m or N].
    arriving : float
        Arriving wave in this device's units [W**0.5].
    last : float
        Resisting effort sent last [N m or N].
    ceiling : float
        Present effort ceiling of the engage ramp [N m or N].

    Returns
    -------
    tuple of float
        Resisting effort to send, its parts by port and wall, the effort asked for before limits
        [N m or N], predicted mean velocity of the acting period [rad/s or m/s].
    """
    mobility = p.port.half_mobility
    coast = velocity - mobility * (impulse + 2.0 * pending)
    wall = 0.0
    if p.has_wall:
        depth = wall_depth(p.wall, position)
        if depth > 0.0:
            wall = clamp(wall_effort(p.wall, depth, wall_velocity), effort_bound(p.limit, ceiling))
            if p.wall.controlled:
                wall = control_wall(p.wall, wall, wall_energy, coast, mobility, p.port.period)
    port, ahead = port_effort(p.port, account, coast - mobility * wall, arriving)
    asked = wall + port
    total = limit_effort(p.limit, asked, last, ceiling)
    if total != asked:
        port = share_effort(wall, port, total)
        wall = total - port
    return total, port, wall, asked, ahead


def think_position(
    p: SiteParams,
    wall_energy: float,
    position: float,
    velocity: float,
    wall_velocity: float,
    impulse: float,
    pending: float,
    far_position: float,
    far_velocity: float,
    last: float,
    ceiling: float,
) -> tuple[float, float, float, float]:
    """Return what an impedance axis of a position coupling shall do; see `think_wave`.

    Returns
    -------
    tuple of float
        Resisting effort to send, its parts by coupler and wall, the effort asked for before
        limits [N m or N].
    """
    wall = 0.0
    if p.has_wall:
        depth = wall_depth(p.wall, position)
        if depth > 0.0:
            wall = clamp(wall_effort(p.wall, depth, wall_velocity), effort_bound(p.limit, ceiling))
            if p.wall.controlled:
                mobility = p.port.half_mobility
                coast = velocity - mobility * (impulse + 2.0 * pending)
                wall = control_wall(p.wall, wall, wall_energy, coast, mobility, p.port.period)
    port = coupler_effort(p.stiffness, p.damping, position, velocity, far_position, far_velocity)
    if p.injection > 0.0:
        port = port + p.injection * velocity
    asked = wall + port
    total = limit_effort(p.limit, asked, last, ceiling)
    if total != asked:
        port = share_effort(wall, port, total)
        wall = total - port
    return total, port, wall, asked


def think_admittance(
    p: SiteParams,
    position: float,
    effort: float,
    pending: float,
    arriving: float,
    ceiling: float,
) -> tuple[float, float, float]:
    """Return what an admittance axis shall do until the next cycle.

    `effort` is the measured outside effort [N m or N], `pending` the sum of the commanded
    velocities that have not acted yet, `ceiling` the engage ramp's velocity ceiling.

    Returns
    -------
    tuple of float
        Velocity to command [rad/s or m/s], resisting effort of the wall in the acting period
        [N m or N], velocity asked for before limits [rad/s or m/s].
    """
    wall_push = 0.0
    wall_stiffness = 0.0
    wall_damping = 0.0
    if p.has_wall:
        ahead = wall_depth(p.wall, position + p.port.period * pending)
        if ahead > 0.0:
            wall_stiffness = p.wall.stiffness
            wall_damping = p.wall.damping
            wall_push = p.wall.side * wall_stiffness * ahead
    asked = admittance_velocity(
        p.admittance, effort, arriving, pending, wall_push, wall_stiffness, wall_damping
    )
    bound = p.limit.velocity
    if ceiling < bound:
        bound = ceiling
    velocity = clamp(asked, bound)
    if p.velocity_quantum > 0.0:
        counts = math.floor(velocity / p.velocity_quantum + 0.5)
        # Rounding is to the nearest step, but never over the limit.
        if p.velocity_quantum * counts > bound:
            counts = counts - 1
        elif p.velocity_quantum * counts < -bound:
            counts = counts + 1
        velocity = p.velocity_quantum * counts
    wall = 0.0
    if wall_stiffness > 0.0:
        half = 0.5 * wall_stiffness * p.port.period
        wall = wall_push + (wall_damping + half) * velocity
    return velocity, wall, asked
