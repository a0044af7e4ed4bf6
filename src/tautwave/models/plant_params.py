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


class PlantCache(NamedTuple):
    """What a full step without an event needs: see `flow_coefficients` for the 15 letters.

    `*_reach` [m/N s] bounds the speed one newton can give within the step; `*_swing` [1] the
    part of its speed a mass can lose to the springs,
    `|v(t) - v| <= h (|net| + h |slope|) / m + swing |v|`.
    """

    step: float
    has_spring: bool
    has_wall: bool
    has_coulomb: bool
    free_stiffness: float
    free_damping: float
    free_reach: float
    free_swing: float
    free_xv: float
    free_xn: float
    free_xs: float
    free_vv: float
    free_vn: float
    free_vs: float
    free_iv: float
    free_in: float
    free_is: float
    free_qvv: float
    free_qvn: float
    free_qvs: float
    free_qnn: float
    free_qns: float
    free_qss: float
    pressing_stiffness: float
    pressing_damping: float
    pressing_reach: float
    pressing_swing: float
    pressing_xv: float
    pressing_xn: float
    pressing_xs: float
    pressing_vv: float
    pressing_vn: float
    pressing_vs: float
    pressing_iv: float
    pressing_in: float
    pressing_is: float
    pressing_qvv: float
    pressing_qvn: float
    pressing_qvs: float
    pressing_qnn: float
    pressing_qns: float
    pressing_qss: float


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


def plant_cache(p: PlantParams, h: float) -> PlantCache:
    """Coefficients of the full step `h` [s] of plant `p`; build it once, not in the loop."""
    stiffness = p.grip_stiffness + p.spring_stiffness
    damping = p.viscous + p.grip_damping
    hard = stiffness + p.wall_stiffness
    sticky = damping + p.wall_damping
    a = flow_coefficients(stiffness, damping, p.mass, h)
    b = flow_coefficients(hard, sticky, p.mass, h)
    return PlantCache(
        h,
        p.spring_stiffness > 0.0,
        p.wall_stiffness > 0.0 or p.wall_damping > 0.0,
        p.coulomb > 0.0,
        stiffness,
        damping,
        greatest_response(stiffness, damping, p.mass, h),
        math.sqrt(stiffness / p.mass) * h,
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
        hard,
        sticky,
        greatest_response(hard, sticky, p.mass, h),
        math.sqrt(hard / p.mass) * h,
        b[0],
        b[1],
        b[2],
        b[3],
        b[4],
        b[5],
        b[6],
        b[7],
        b[8],
        b[9],
        b[10],
        b[11],
        b[12],
        b[13],
        b[14],
    )
