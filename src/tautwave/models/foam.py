"""Mass on a contact `F = k y**a (1 + loss ydot) + damping ydot >= 0`, by the discrete gradient.

The potential enters as the mean force `(V(y + u) - V(y)) / u` over the sub-step's movement u, so
the energy books close to the accuracy of the solver whatever the stiffness (Chatziioannou, van
Walstijn, JSV 2015). Order 2; the root is unique because every force grows with u.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.models.plant_params import PlantParams

_ITERATIONS = 80
_DEEP = 1e15  # depth beyond which a power is no longer formed; no float overflows up to a = 18
_MAX_SUBSTEPS = 1000


class FoamParams(NamedTuple):
    """Power-law contact that fills `side * (x - position) > 0`.

    `stiffness` [N/m**a], `exponent` a >= 1, `loss` [s/m] >= 0, and the `substeps` of a step. With
    `damping` [N s/m] it is a Kelvin-Voigt wall that lets go. `scheme` is the number of an
    integrator of `models.integrators`, 0 the discrete gradient, and `tolerance` that of an
    adaptive one.
    """

    stiffness: float
    exponent: float
    loss: float
    position: float
    side: float
    substeps: int
    damping: float = 0.0
    scheme: int = 0
    tolerance: float = 1e-10


def elastic_force(foam: FoamParams, depth: float) -> float:
    """Static force at a depth."""
    if not depth > 0.0:
        return 0.0
    if depth > _DEEP:
        depth = _DEEP
    return foam.stiffness * math.pow(depth, foam.exponent)


def elastic_energy(foam: FoamParams, depth: float) -> float:
    """Energy stored at a depth."""
    if not depth > 0.0:
        return 0.0
    if depth > _DEEP:
        depth = _DEEP
    return foam.stiffness * math.pow(depth, foam.exponent + 1.0) / (foam.exponent + 1.0)


def foam_substeps(
    plant: PlantParams, foam: FoamParams, speed: float, effort: float, h: float
) -> int:
    """Sub-steps per step `h` [s] for a relative error of some 1e-4 in a contact.

    `speed` [m/s or rad/s] and `effort` [N or N m] are the greatest ones expected; they set the
    depth y and so the stiffness k a y**(a-1). About 60 sub-steps fit in one bounce, at most 1000
    in a step; the energy books close with any number.
    """
    a = foam.exponent
    energy = 0.5 * plant.mass * speed * speed
    depth = math.pow((a + 1.0) * energy / foam.stiffness, 1.0 / (a + 1.0))
    pressed = math.pow(math.fabs(effort) / foam.stiffness, 1.0 / a)
    if pressed > depth:
        depth = pressed
    hardness = plant.grip_stiffness
    if depth > 0.0:
        hardness = hardness + foam.stiffness * a * math.pow(depth, a - 1.0)
    rate = math.sqrt(hardness / plant.mass)
    damping = (plant.viscous + plant.grip_damping) / plant.mass
    if damping > rate:
        rate = damping
    needed = rate * h / 0.05
    if not needed < _MAX_SUBSTEPS:
        return _MAX_SUBSTEPS
    return int(needed) + 1


def _mean_force(foam: FoamParams, depth: float, held: float, u: float) -> tuple[float, float]:
    """Discrete gradient over a movement u and its derivative; `held` is the potential now."""
    after = depth + u
    size = math.fabs(u)
    if depth > 0.0 and size < 1e-3 * depth:
        # The difference below would lose digits: mean of the Taylor series about the middle.
        middle = depth + 0.5 * u
        force = elastic_force(foam, middle)
        a = foam.exponent
        ratio = u / middle
        square = ratio * ratio
        bend = a * (a - 1.0) * (1.0 + (a - 2.0) * (a - 3.0) * square / 80.0) / 24.0
        return force * (1.0 + bend * square), 0.5 * a * force / middle
    if size == 0.0:
        return elastic_force(foam, depth), 0.0
    mean = (elastic_energy(foam, after) - held) / u
    return mean, (elastic_force(foam, after) - mean) / u


def _drag(foam: FoamParams, depth: float, u: float, t: float) -> float:
    """Mean force of the damper, which acts along the part of the movement u that is inside."""
    sunk = depth + u
    if not sunk > 0.0:
        sunk = 0.0
    if depth > 0.0:
        sunk = sunk - depth
    return foam.damping * sunk / t


def foam_movement(
    foam: FoamParams, depth: float, free: float, inertia: float, t: float
) -> tuple[float, float, float, int]:
    """Solve `inertia (u - free) + F(u) = 0` for the movement u into the contact.

    `free` is the movement without the contact: as a difference from it u carries the rounding of
    the forces only, and a step that touches nothing keeps its speed to the bit.

    Returns
    -------
    tuple
        u, the elastic mean force, the clipped factor `1 + loss u / t`, and the iterations. The
        damper's share is that of `_drag`; elastic force and drag together never pull.
    """
    high = free
    push = inertia * free
    if not (depth > 0.0 or depth + high > 0.0):
        return high, 0.0, 1.0, 0
    now = elastic_force(foam, depth)
    low = 0.0
    if push <= now:
        low = (push - now) / inertia
        if high > 0.0:
            high = 0.0
    held = elastic_energy(foam, depth)
    if high > 0.0 and elastic_energy(foam, depth + high) - held > 2.0 * push * high:
        # Very stiff: the work of `push` bounds the depth far better than inertia alone.
        bound = (foam.exponent + 1.0) * (held + push * high) / foam.stiffness
        deepest = math.pow(bound, 1.0 / (foam.exponent + 1.0)) * (1.0 + 1e-12) - depth
        if low < deepest < high:
            high = deepest
    u = high
    count = 0
    for _ in range(_ITERATIONS):
        count = count + 1
        mean, bend = _mean_force(foam, depth, held, u)
        factor = 1.0 + foam.loss * u / t
        slope = inertia
        if factor > 0.0:
            slope = slope + bend * factor + mean * foam.loss / t
        else:
            factor = 0.0
        if foam.damping > 0.0:
            drag = _drag(foam, depth, u, t)
            if mean * factor + drag > 0.0:
                if depth + u > 0.0:
                    slope = slope + foam.damping / t
                pull = mean * factor + drag
            else:
                slope = inertia
                pull = 0.0
        else:
            pull = mean * factor
        excess = inertia * (u - free) + pull
        if math.fabs(excess) <= 6e-16 * (math.fabs(inertia * u) + pull + math.fabs(push)):
            u = u - excess / slope  # Newton ends on one side; a thousand steps would add it up
            break
        if excess > 0.0:
            high = u
        else:
            low = u
        following = u - excess / slope
        if not (low <= following <= high):
            following = 0.5 * (low + high)
        change = math.fabs(following - u)
        u = following
        if change <= 4e-16 * math.fabs(u):
            break
    mean, _ = _mean_force(foam, depth, held, u)
    factor = 1.0 + foam.loss * u / t
    if not factor > 0.0:
        factor = 0.0
    return u, mean, factor, count


def foam_step(
    plant: PlantParams,
    foam: FoamParams,
    x: float,
    v: float,
    effort: float,
    reference: float,
    reference_rate: float,
    h: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Move a plant at a foam on by `h` [s] in `foam.substeps` sub-steps; as `plant_step`.

    Mass, viscous and Coulomb friction, grip and spring come from `plant`; its wall is not used.
    Where Coulomb friction can hold the mass through a sub-step it stops, and its kinetic energy is
    booked as Coulomb loss.

    Returns
    -------
    tuple
        x, v, then in J: hand work, grip loss, viscous loss, Coulomb loss, environment loss.
    """
    hand_work = 0.0
    grip_loss = 0.0
    viscous_loss = 0.0
    coulomb_loss = 0.0
    environment_loss = 0.0
    t = h / foam.substeps
    damping = plant.viscous + plant.grip_damping
    rest = 0.5 * plant.grip_stiffness + damping / t
    if plant.spring_stiffness > 0.0:
        rest = rest + 0.5 * plant.spring_stiffness
    inertia = 2.0 * plant.mass / (t * t) + rest
    swept = reference_rate * t
    for i in range(foam.substeps):
        ahead = reference + reference_rate * (t * i) - x + 0.5 * swept
        outside = effort + plant.grip_stiffness * ahead + plant.grip_damping * reference_rate
        if plant.spring_stiffness > 0.0:
            outside = outside - plant.spring_stiffness * (x - plant.spring_position)
        glide = t * v
        free = foam.side * (glide + (outside - rest * glide) / inertia)
        depth = foam.side * (x - foam.position)
        moved = 0.0
        held = False
        friction = 0.0
        if plant.coulomb > 0.0:
            drive = inertia * free - elastic_force(foam, depth)
            if drive > plant.coulomb:
                friction = plant.coulomb
            elif drive < -plant.coulomb:
                friction = -plant.coulomb
            else:
                held = True
        if held:
            coulomb_loss = coulomb_loss + 0.5 * plant.mass * v * v
            v = 0.0
        else:
            free = free - friction / inertia
            moved, mean, factor, _ = foam_movement(foam, depth, free, inertia, t)
            coulomb_loss = coulomb_loss + friction * moved
            environment_loss = environment_loss + mean * moved * (factor - 1.0)
            if foam.damping > 0.0:
                drag = _drag(foam, depth, moved, t)
                if not mean * factor + drag > 0.0:
                    drag = -mean * factor  # it lets go: all that is stored and gets free is lost
                environment_loss = environment_loss + drag * moved
            moved = foam.side * moved
            v = v + 2.0 * (moved - glide) / t
            x = x + moved
        slip = swept - moved
        hand_work = hand_work + reference_rate * (
            plant.grip_stiffness * t * (ahead - 0.5 * moved) + plant.grip_damping * slip
        )
        grip_loss = grip_loss + plant.grip_damping * slip * slip / t
        viscous_loss = viscous_loss + plant.viscous * moved * moved / t
    return (
        x,
        v,
        hand_work,
        grip_loss,
        viscous_loss,
        coulomb_loss,
        environment_loss,
    )


def foam_stored(
    plant: PlantParams, foam: FoamParams, x: float, v: float, reference: float
) -> tuple[float, float, float]:
    """Stored energy [J]: kinetic, in the grip's spring, in the foam."""
    ahead = reference - x
    environment = elastic_energy(foam, foam.side * (x - foam.position))
    if plant.spring_stiffness > 0.0:
        stretch = x - plant.spring_position
        environment = environment + 0.5 * plant.spring_stiffness * stretch * stretch
    return (
        0.5 * plant.mass * v * v,
        0.5 * plant.grip_stiffness * ahead * ahead,
        environment,
    )


def foam_forces(
    plant: PlantParams,
    foam: FoamParams,
    x: float,
    v: float,
    reference: float,
    reference_rate: float,
) -> tuple[float, float]:
    """Force of the hand's grip and of the foam on the mass, positive along x."""
    hand = plant.grip_stiffness * (reference - x) + plant.grip_damping * (reference_rate - v)
    depth = foam.side * (x - foam.position)
    factor = 1.0 + foam.loss * foam.side * v
    if foam.damping > 0.0 or plant.spring_stiffness > 0.0:
        environment = 0.0
        if plant.spring_stiffness > 0.0:
            environment = -plant.spring_stiffness * (x - plant.spring_position)
        if not factor > 0.0:
            factor = 0.0
        pull = factor * elastic_force(foam, depth)
        if depth > 0.0:
            pull = pull + foam.damping * foam.side * v
        if pull > 0.0:
            environment = environment - foam.side * pull
        return hand, environment
    if not factor > 0.0:
        return hand, 0.0
    return hand, -foam.side * factor * elastic_force(foam, depth)
