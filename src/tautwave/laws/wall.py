"""Local virtual wall: unilateral spring and damper on this side's own measured position.

Sources: Colgate & Schenkel, "Passivity of a class of sampled-data systems", J. Robotic Systems
14(1), 1997; Hannaford & Ryu, "Time-domain passivity control of haptic interfaces", IEEE Trans.
Robotics and Automation 18(1), 2002 (observer and controller).
"""

from __future__ import annotations

import math
from typing import NamedTuple


class WallParams(NamedTuple):
    """Wall constants: position; side +1.0 (fills x > position) or -1.0; stiffness K; damping B.

    `controlled` turns on the passivity controller; without it that acts on a wall in debt only.
    reserve: the greatest debt [J]; reach: how far the device may go while a stalled host holds an
    effort [rad or m]; drift: how much farther each unit of that effort takes it [rad/(N m) or m/N];
    most: the effort that a wall without debt may so hold, most (reach + drift most) = reserve.
    """

    position: float
    side: float
    stiffness: float
    damping: float
    controlled: bool
    reserve: float = math.inf
    reach: float = 0.0
    drift: float = 0.0
    most: float = math.inf


NO_WALL = WallParams(0.0, 1.0, 0.0, 0.0, controlled=False)


def wall_depth(p: WallParams, position: float) -> float:
    """Return the penetration [rad or m], 0 outside."""
    depth = p.side * (position - p.position)
    if depth > 0.0:
        return depth
    return 0.0


def wall_effort(p: WallParams, depth: float, velocity: float) -> float:
    """Return the resisting effort K depth + B ddepth/dt, never pulling [N m or N]."""
    if depth <= 0.0:
        return 0.0
    push = p.stiffness * depth + p.damping * (p.side * velocity)
    if push > 0.0:
        return p.side * push
    return 0.0


def wall_stored(p: WallParams, depth: float) -> float:
    """Return the energy K depth**2 / 2 of the wall's spring [J]."""
    return 0.5 * p.stiffness * depth * depth


def wall_loss(
    p: WallParams, effort: float, displacement: float, before: float, after: float
) -> float:
    """Return the energy the wall dissipated in a period [J]; negative if sampling created energy.

    `effort` is the resisting effort that acted, `before` and `after` are the depths. For a pure
    spring in contact this is -K displacement**2 / 2: the leak of the held force.
    """
    return effort * displacement - 0.5 * p.stiffness * (after - before) * (after + before)


def hold_wall(p: WallParams, effort: float, energy: float) -> float:
    """Limit a wall's resisting effort to what a host that stalls may hold it for.

    The greatest F with F (reach + drift F) <= reserve + min(energy, 0): the debt that a stall may
    leave never exceeds the reserve. The constants of a rig allow for all that its wall asks for;
    one that was made stiffer since is held at that, its `most`, and one in debt pushes less.

    Parameters
    ----------
    p : WallParams
        Wall.
    effort : float
        Resisting effort of the wall [N m or N].
    energy : float
        Energy absorbed since contact began, less what was owed then [J].

    Returns
    -------
    float
        Resisting effort [N m or N], of the same sign and never larger.
    """
    push = p.side * effort
    left = p.reserve
    if energy < 0.0:
        left = left + energy
    if push > 0.0 and push * (p.reach + p.drift * push) > left:
        if left <= 0.0:
            return 0.0
        push = 2.0 * left / (p.reach + math.sqrt(p.reach * p.reach + 4.0 * p.drift * left))
        return p.side * push
    return effort


def control_wall(
    p: WallParams,
    effort: float,
    energy: float,
    free_velocity: float,
    half_mobility: float,
    period: float,
) -> float:
    """Limit a wall's resisting effort so that it returns no more energy than it absorbed.

    Passivity controller with an exact energy observer. In the wall's direction the device will
    move by T (c - mu F) in the acting period, c the coasting velocity and mu = T / (2 mass lower
    bound); the greatest F that keeps energy + F T (c - mu F) >= 0 is the positive root.

    A host that stalls holds F for longer, and the wall may be in debt after that. It pays before it
    gives again, and pushes no harder than another stall may cost (`hold_wall`).

    Parameters
    ----------
    p : WallParams
        Wall.
    effort : float
        Resisting effort of the wall, up to its `most` [N m or N].
    energy : float
        Energy absorbed since contact began, less what was owed then [J].
    free_velocity : float
        Predicted mean velocity without the wall's effort [rad/s or m/s].
    half_mobility : float
        T / (2 lower bound of mass).
    period : float
        Loop period T [s].

    Returns
    -------
    float
        Resisting effort [N m or N], of the same sign and never larger.
    """
    if energy < 0.0:
        effort = hold_wall(p, effort, energy)
    push = p.side * effort
    retreat = -p.side * free_velocity
    if push <= 0.0 or energy + push * period * (-retreat - half_mobility * push) >= 0.0:
        return effort
    if energy <= 0.0:
        if retreat >= 0.0:
            return 0.0
        # Still entering: any push below c / mu takes energy in.
        greatest = -retreat / half_mobility
        if push > greatest:
            push = greatest
        return p.side * push
    reach = math.sqrt(retreat * retreat + 4.0 * half_mobility * energy / period)
    if retreat >= 0.0:
        return p.side * (2.0 * energy / period / (reach + retreat))
    return p.side * ((reach - retreat) / (2.0 * half_mobility))
