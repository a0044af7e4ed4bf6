"""Integrators by name for a mass at a contact, each with its order, bound and energy behaviour.

The motion is `m a = effort + grip + spring - viscous v - coulomb sign(v) - contact`, the contact
that of `models.foam`: `k y**a (1 + loss ydot) + damping ydot`, never negative. w is the rate
`sqrt(stiffness / m)` [1/s], t the sub-step [s].

========================  =====  ===================  ============================================
scheme                    order  bound                energy
========================  =====  ===================  ============================================
exact                     all    none                 exact; piecewise-linear surroundings only
discrete_gradient (0)     2      none                 closed to rounding, any stiffness and exponent
symplectic_euler (1)      1      w t < 2              swings by w t / 2, no drift while smooth
implicit_midpoint (2)     2      none if linear       exact if linear; gains at a stiff contact
rk4 (3)                   4      w t < 2.8            loses (w t)**6 / 72 of it a step
dormand_prince (4)        5      its own steps        within its tolerance; contacts are located
========================  =====  ===================  ============================================

The orders are those of smooth motion. A scheme that steps across a contact's edge has at most
order a + 1 there (a linear wall: 2, Hertz: 2.5), except `exact` and `dormand_prince`, which locate
it; between free flights symplectic Euler is a shifted Verlet, order 2. A stop in Coulomb friction
is order 1 in all but those two. Which step each of them can hold a contact at is in
`models.integrator_bounds`, which one is cheapest in `models.integrator_choice`.

Sources: Hairer, Lubich, Wanner, Geometric Numerical Integration, I.1 and II.1; Chatziioannou, van
Walstijn, JSV 2015 (discrete gradient); Dormand, Prince, J. Comp. Appl. Math. 6, 1980.
"""

from __future__ import annotations

import math

from tautwave.models.foam import FoamParams, elastic_force, foam_step
from tautwave.models.integrators.adaptive import dormand_prince_step
from tautwave.models.plant_params import PlantParams

EXACT = -1
DISCRETE_GRADIENT = 0
SYMPLECTIC_EULER = 1
IMPLICIT_MIDPOINT = 2
RK4 = 3
DORMAND_PRINCE = 4

SCHEMES = {
    "exact": EXACT,
    "discrete_gradient": DISCRETE_GRADIENT,
    "symplectic_euler": SYMPLECTIC_EULER,
    "implicit_midpoint": IMPLICIT_MIDPOINT,
    "rk4": RK4,
    "dormand_prince": DORMAND_PRINCE,
}
"""Number of each scheme by its name in a rig file."""

_ITERATIONS = 80

FoamStep = tuple[float, float, float, float, float, float, float]
Rates = tuple[float, float, float, float]
SubStep = tuple[float, float, float, float, float, float]


def contact_pull(foam: FoamParams, depth: float, speed: float) -> tuple[float, float]:
    """Return the static force of a contact and its whole one, >= 0; `speed` is into it [N, N]."""
    if not depth > 0.0:
        return 0.0, 0.0
    elastic = elastic_force(foam, depth)
    pull = elastic * (1.0 + foam.loss * speed) + foam.damping * speed
    if not pull > 0.0:
        return elastic, 0.0
    return elastic, pull


def motion_rates(
    plant: PlantParams,
    foam: FoamParams,
    friction: float,
    effort: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
) -> Rates:
    """Return acceleration, then in W: power of the hand, of the grip's loss and the contact's.

    `friction` is the Coulomb force that acts against positive motion.
    """
    slip = reference_rate - v
    grip = plant.grip_stiffness * (reference - x) + plant.grip_damping * slip
    speed = foam.side * v
    elastic, pull = contact_pull(foam, foam.side * (x - foam.position), speed)
    force = effort + grip - plant.viscous * v - friction - foam.side * pull
    if plant.spring_stiffness > 0.0:
        force = force - plant.spring_stiffness * (x - plant.spring_position)
    return (
        force / plant.mass,
        reference_rate * grip,
        plant.grip_damping * slip * slip,
        (pull - elastic) * speed,
    )


def symplectic_euler_substep(
    plant: PlantParams,
    foam: FoamParams,
    friction: float,
    effort: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
    t: float,
) -> SubStep:
    """Kick by the force at the start, then drift, over `t` [s].

    Returns
    -------
    tuple
        x, v, then in J: hand work, grip loss, viscous loss, contact loss.
    """
    a, power, _, _ = motion_rates(plant, foam, friction, effort, reference, reference_rate, x, v)
    after = v + t * a
    moved = t * after
    elastic, pull = contact_pull(foam, foam.side * (x - foam.position), foam.side * v)
    # Forces at the start times the movement: every loss is what the scheme really took.
    grip_loss = plant.grip_damping * (reference_rate - v) * (reference_rate * t - moved)
    return (
        x + moved,
        after,
        t * power,
        grip_loss,
        plant.viscous * v * moved,
        (pull - elastic) * foam.side * moved,
    )


def rk4_substep(
    plant: PlantParams,
    foam: FoamParams,
    friction: float,
    effort: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
    t: float,
) -> SubStep:
    """Kutta's classical step over `t` [s]; works and losses are integrated by the same weights.

    Returns
    -------
    tuple
        x, v, then in J: hand work, grip loss, viscous loss, contact loss.
    """
    half = 0.5 * t
    middle = reference + reference_rate * half
    a1, p1, g1, c1 = motion_rates(plant, foam, friction, effort, reference, reference_rate, x, v)
    v2 = v + half * a1
    a2, p2, g2, c2 = motion_rates(
        plant, foam, friction, effort, middle, reference_rate, x + half * v, v2
    )
    v3 = v + half * a2
    a3, p3, g3, c3 = motion_rates(
        plant, foam, friction, effort, middle, reference_rate, x + half * v2, v3
    )
    v4 = v + t * a3
    end = reference + reference_rate * t
    a4, p4, g4, c4 = motion_rates(
        plant, foam, friction, effort, end, reference_rate, x + t * v3, v4
    )
    w = t / 6.0
    return (
        x + w * (v + 2.0 * (v2 + v3) + v4),
        v + w * (a1 + 2.0 * (a2 + a3) + a4),
        w * (p1 + 2.0 * (p2 + p3) + p4),
        w * (g1 + 2.0 * (g2 + g3) + g4),
        w * plant.viscous * (v * v + 2.0 * (v2 * v2 + v3 * v3) + v4 * v4),
        w * (c1 + 2.0 * (c2 + c3) + c4),
    )


def midpoint_movement(
    foam: FoamParams, depth: float, push: float, inertia: float, t: float
) -> tuple[float, float]:
    """Solve `inertia u + F(y + u/2, u/t) = push` for the movement u into the contact.

    Returns
    -------
    tuple
        u [m or rad], and the iterations.
    """
    high = push / inertia
    if not (depth > 0.0 or depth + 0.5 * high > 0.0):
        return high, 0.0
    now, _ = contact_pull(foam, depth, 0.0)
    low = 0.0
    if push <= now:
        low = (push - now) / inertia
        if high > 0.0:
            high = 0.0
    u = high
    count = 0.0
    for _ in range(_ITERATIONS):
        count = count + 1.0
        middle = depth + 0.5 * u
        speed = u / t
        elastic, pull = contact_pull(foam, middle, speed)
        excess = inertia * u + pull - push
        if math.fabs(excess) <= 6e-16 * (math.fabs(inertia * u) + pull + math.fabs(push)):
            break
        if excess > 0.0:
            high = u
        else:
            low = u
        slope = inertia
        if pull > 0.0:
            factor = 1.0 + foam.loss * speed
            slope = slope + 0.5 * foam.exponent * elastic / middle * factor
            slope = slope + (elastic * foam.loss + foam.damping) / t
        following = u - excess / slope
        if not (low <= following <= high):
            following = 0.5 * (low + high)
        change = math.fabs(following - u)
        u = following
        if change <= 4e-16 * math.fabs(u):
            break
    return u, count


def implicit_midpoint_substep(
    plant: PlantParams,
    foam: FoamParams,
    friction: float,
    effort: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
    t: float,
) -> SubStep:
    """Step over `t` [s] by the forces half-way between start and end; Newton, bracketed.

    Returns
    -------
    tuple
        x, v, then in J: hand work, grip loss, viscous loss, contact loss.
    """
    momentum = 2.0 * plant.mass / t
    damping = plant.viscous + plant.grip_damping
    stiffness = plant.grip_stiffness + plant.spring_stiffness
    inertia = momentum / t + 0.5 * stiffness + damping / t
    swept = reference_rate * t
    ahead = reference - x + 0.5 * swept
    outside = effort + plant.grip_stiffness * ahead + plant.grip_damping * reference_rate
    if plant.spring_stiffness > 0.0:
        outside = outside - plant.spring_stiffness * (x - plant.spring_position)
    push = foam.side * (momentum * v + outside - friction)
    depth = foam.side * (x - foam.position)
    u, _ = midpoint_movement(foam, depth, push, inertia, t)
    elastic, pull = contact_pull(foam, depth + 0.5 * u, u / t)
    moved = foam.side * u
    slip = swept - moved
    grip = plant.grip_stiffness * t * (ahead - 0.5 * moved) + plant.grip_damping * slip
    return (
        x + moved,
        2.0 * moved / t - v,
        reference_rate * grip,
        plant.grip_damping * slip * slip / t,
        plant.viscous * moved * moved / t,
        (pull - elastic) * u,
    )


def integrate_step(
    plant: PlantParams,
    foam: FoamParams,
    x: float,
    v: float,
    effort: float,
    reference: float,
    reference_rate: float,
    h: float,
) -> FoamStep:
    """Move a plant at a contact on by `h` [s] by the scheme that `foam` names; as `foam_step`.

    Where Coulomb friction turns the motion within a sub-step the mass stops at the sub-step's end
    and its kinetic energy is booked as Coulomb loss.

    Returns
    -------
    tuple
        x, v, then in J: hand work, grip loss, viscous loss, Coulomb loss, environment loss. What
        the books lack is the energy that the scheme itself made or took.
    """
    if foam.scheme == DISCRETE_GRADIENT:
        return foam_step(plant, foam, x, v, effort, reference, reference_rate, h)
    if foam.scheme == DORMAND_PRINCE:
        return dormand_prince_step(plant, foam, x, v, effort, reference, reference_rate, h)
    hand_work = 0.0
    grip_loss = 0.0
    viscous_loss = 0.0
    coulomb_loss = 0.0
    environment_loss = 0.0
    t = h / foam.substeps
    for i in range(foam.substeps):
        aim = reference + reference_rate * (t * i)
        direction = 0.0
        held = False
        if v > 0.0:
            direction = 1.0
        elif v < 0.0:
            direction = -1.0
        elif plant.coulomb > 0.0:
            a, _, _, _ = motion_rates(plant, foam, 0.0, effort, aim, reference_rate, x, v)
            if plant.mass * a > plant.coulomb:
                direction = 1.0
            elif plant.mass * a < -plant.coulomb:
                direction = -1.0
            else:
                held = True
        if held:
            swept = reference_rate * t
            grip = plant.grip_stiffness * (aim - x + 0.5 * swept)
            grip = grip + plant.grip_damping * reference_rate
            hand_work = hand_work + swept * grip
            grip_loss = grip_loss + plant.grip_damping * reference_rate * swept
            continue
        before = x
        friction = plant.coulomb * direction
        if foam.scheme == SYMPLECTIC_EULER:
            x, v, work, grip, viscous, environment = symplectic_euler_substep(
                plant, foam, friction, effort, aim, reference_rate, x, v, t
            )
        elif foam.scheme == IMPLICIT_MIDPOINT:
            x, v, work, grip, viscous, environment = implicit_midpoint_substep(
                plant, foam, friction, effort, aim, reference_rate, x, v, t
            )
        else:
            x, v, work, grip, viscous, environment = rk4_substep(
                plant, foam, friction, effort, aim, reference_rate, x, v, t
            )
        hand_work = hand_work + work
        grip_loss = grip_loss + grip
        viscous_loss = viscous_loss + viscous
        environment_loss = environment_loss + environment
        if plant.coulomb > 0.0:
            coulomb_loss = coulomb_loss + friction * (x - before)
            if v * direction < 0.0:
                coulomb_loss = coulomb_loss + 0.5 * plant.mass * v * v
                v = 0.0
    return x, v, hand_work, grip_loss, viscous_loss, coulomb_loss, environment_loss
