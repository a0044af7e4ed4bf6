"""Parameters of an impedance-axis plant and the coefficients cached for its full step."""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.models.linear import flow_coefficients


class PlantParams(NamedTuple):
    """A mass with friction, held by a hand, at a spring or a wall; SI of its axis.

    `grip_*` tie the mass to the hand's reference motion; `spring_*` is a bilateral spring of the
    environment; the wall is a Kelvin-Voigt one, fills `wall_side * (x - wall_position) > 0`, and
    only pushes. Zero stiffness and damping mean: not there. Everything is >= 0, mass > 0.
    """

    mass: float
    viscous: float
    coulomb: float
    grip_stiffness: float
    grip_damping: float
    spring_stiffness: float
    spring_position: float
    wall_stiffness: float
    wall_damping: float
    wall_position: float
    wall_side: float


class FlowCache(NamedTuple):
    """Full step of one linear mode: totals, bounds, and the 15 of `flow_coefficients`.

    `reach` [m/N s] bounds the speed one newton can give within the step; `swing` [1] the part of
    its speed a mass can lose to the springs, `|v(t) - v| <= h (|net| + h |slope|) / m + swing |v|`.
    """

    stiffness: float
    damping: float
    reach: float
    swing: float
    xv: float
    xn: float
    xs: float
    vv: float
    vn: float
    vs: float
    av: float
    an: float
    as_: float
    qvv: float
    qvn: float
    qvs: float
    qnn: float
    qns: float
    qss: float


class PlantCache(NamedTuple):
    """What a full step without an event needs: its length [s], the parts there are, the modes."""

    step: float
    has_spring: bool
    has_wall: bool
    has_coulomb: bool
    free: FlowCache
    pressing: FlowCache


def greatest_response(stiffness: float, damping: float, mass: float, t: float) -> float:
    """Bound of the speed that a unit of net force at rest leads to within `t` [s], in 1/(N s/m).

    A passive mass-spring-damper answers a unit force with at most t/m, 1/sqrt(k m) and 1/b.
    """
    bound = t / mass
    if stiffness * mass * bound * bound > 1.0:
        bound = 1.0 / math.sqrt(stiffness * mass)
    if damping * bound > 1.0:
        bound = 1.0 / damping
    return bound


def flow_cache(stiffness: float, damping: float, mass: float, h: float) -> FlowCache:
    """Coefficients and bounds of the step `h` [s] of one linear mode."""
    a = flow_coefficients(stiffness, damping, mass, h)
    return FlowCache(
        stiffness,
        damping,
        greatest_response(stiffness, damping, mass, h),
        math.sqrt(stiffness / mass) * h,
        a[0],
        a[1],
        a[2],
        a[3],
        a[4],
        a[5],
        a[6],
        a[7],
        a[8],
        a[9],
        a[10],
        a[11],
        a[12],
        a[13],
        a[14],
    )


def plant_cache(p: PlantParams, h: float) -> PlantCache:
    """Coefficients of the full step `h` [s] of plant `p`; build it once, not in the loop."""
    stiffness = p.grip_stiffness + p.spring_stiffness
    damping = p.viscous + p.grip_damping
    return PlantCache(
        h,
        p.spring_stiffness > 0.0,
        p.wall_stiffness > 0.0 or p.wall_damping > 0.0,
        p.coulomb > 0.0,
        flow_cache(stiffness, damping, p.mass, h),
        flow_cache(stiffness + p.wall_stiffness, damping + p.wall_damping, p.mass, h),
    )
