"""A local model of what another device touches, rendered: a surface whose change is paid for.

A surface that becomes stiffer, or moves, while it is pressed in by d puts d K d**2 / 2 into its
spring, out of nothing. So the spring may hold at most what an account covers:

    K d**2 / 2 <= funds,

and a rise is taken from them, a fall returned. Not pressed, a surface becomes at once what is
known. Damping is what is known of the environment's, and what keeps a spring that is held over a
period from gaining energy on a device without friction: more than K T (1/2 + n).

Sources: Hannaford 1989 and Mitra & Niemeyer, Int. J. Robotics Research 27(2), 2008 (model-mediated
telemanipulation); the rule by the funds is derived here.
"""

from __future__ import annotations

from typing import NamedTuple

from tautwave.couplings.mediated.contact import Surface


class ModelParams(NamedTuple):
    """Constants of a rendered model.

    share: of what a pressed surface is off, what it adopts per period [1]; span [s]: damping that
    is rendered per stiffness at least; most [N m s/rad or N s/m]: damping at most.
    """

    share: float
    span: float
    most: float


def depth_in(s: Surface, side: float, x: float) -> float:
    """Return how far a device is in a surface [rad or m], 0 outside."""
    depth = side * (x - s.position)
    if s.stiffness > 0.0 and depth > 0.0:
        return depth
    return 0.0


def stored_in(s: Surface, side: float, x: float) -> float:
    """Return what a surface's spring holds [J]."""
    depth = depth_in(s, side, x)
    return 0.5 * s.stiffness * depth * depth


def adopt(
    p: ModelParams, s: Surface, known: Surface, side: float, x: float, periods: float, funds: float
) -> float:
    """Bring a rendered surface towards what is known; return what its spring then holds more [J].

    Parameters
    ----------
    p : ModelParams
        Constants.
    s, known : Surface
        As rendered, and as known.
    side, x : float
        Of the surface, +1 or -1; position of the device that feels it [rad or m].
    periods : float
        Since the last time.
    funds : float
        What the spring may hold [J].
    """
    before = stored_in(s, side, x)
    if s.stiffness == 0.0 or side * (x - s.position) <= 0.0:
        if side * (x - known.position) <= 0.0:
            s.stiffness = known.stiffness
            s.damping = known.damping
            s.position = known.position
            return -before
        if s.stiffness == 0.0:
            s.position = known.position
    share = p.share * periods
    if share > 1.0:
        share = 1.0
    s.stiffness += share * (known.stiffness - s.stiffness)
    s.damping += share * (known.damping - s.damping)
    s.position += share * (known.position - s.position)
    depth = depth_in(s, side, x)
    if funds < 0.0:
        funds = 0.0
    if 0.5 * s.stiffness * depth * depth > funds:
        s.stiffness = 2.0 * funds / (depth * depth)
    return stored_in(s, side, x) - before


def damping_of(p: ModelParams, s: Surface) -> float:
    """Return the damping that a surface is rendered with [N m s/rad or N s/m]."""
    least = p.span * s.stiffness
    damping = s.damping
    if damping < least:
        damping = least
    if damping > p.most:
        damping = p.most
    return damping


def push_of(p: ModelParams, s: Surface, side: float, x: float, v: float) -> float:
    """Return the resisting effort of a surface [N m or N], which never pulls."""
    depth = depth_in(s, side, x)
    if depth == 0.0:
        return 0.0
    push = s.stiffness * depth + damping_of(p, s) * (side * v)
    if push > 0.0:
        return side * push
    return 0.0
