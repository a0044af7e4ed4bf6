"""Dormand and Prince's fifth-order pair with located contacts and stops: the oracle of `models`.

Every stretch is smooth: contact free, pressing or clipped (it would have to pull, so it lets go),
friction in one direction. A trial step across an edge is cut to where the edge is, and the next
stretch begins there. SI of the axis; source: Dormand, Prince, J. Comp. Appl. Math. 6, 1980.
"""

from __future__ import annotations

import math

from tautwave.models.foam import FoamParams, elastic_force
from tautwave.models.plant_params import PlantParams

FREE = 0
PRESSING = 1
CLIPPED = 2


def release_level(foam: FoamParams, depth: float, speed: float) -> float:
    """Return what is above zero while a contact at `depth` pushes; `speed` is into it [SI]."""
    if foam.damping > 0.0:
        return elastic_force(foam, depth) * (1.0 + foam.loss * speed) + foam.damping * speed
    return 1.0 + foam.loss * speed


def contact_now(foam: FoamParams, depth: float, speed: float) -> int:
    """Return FREE, PRESSING or CLIPPED at a depth and a speed into the contact [SI]."""
    if depth < 0.0 or (depth == 0.0 and not speed > 0.0):
        return FREE
    if release_level(foam, depth, speed) < 0.0:
        return CLIPPED
    return PRESSING


def edge_level(
    foam: FoamParams, contact: int, direction: float, edge: int, x: float, v: float
) -> float:
    """Return what is below zero until the motion reaches an edge [SI].

    Edge 0 is the surface, 1 where the contact begins or ends to push, 2 a stop of the friction.
    """
    if edge == 2:
        return -direction * v
    depth = foam.side * (x - foam.position)
    if edge == 0:
        if contact == FREE:
            return depth
        return -depth
    level = release_level(foam, depth, foam.side * v)
    if contact == CLIPPED:
        return level
    return -level


_TRIALS = 200_000
_BISECTIONS = 60
_SMALLEST = 1e-9  # of a step; below it the error estimate is rounding
_SAFETY = 0.9
_ROUNDING = 1e-15  # least error per step, whatever the tolerance
_NOISE = 4e-15  # of the forces that balance each other: what their difference is worth

FoamStep = tuple[float, float, float, float, float, float, float]
Rates = tuple[float, float, float, float]
Trial = tuple[float, float, float, float, float, float, float, float]


def _rates(
    plant: PlantParams,
    foam: FoamParams,
    contact: int,
    outside: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
) -> Rates:
    """Acceleration, power of the hand, of the grip's loss and of the contact's, in one mode."""
    slip = reference_rate - v
    grip = plant.grip_stiffness * (reference - x) + plant.grip_damping * slip
    force = outside + grip - plant.viscous * v
    if plant.spring_stiffness > 0.0:
        force = force - plant.spring_stiffness * (x - plant.spring_position)
    lost = 0.0
    if contact != FREE:
        speed = foam.side * v
        elastic = elastic_force(foam, foam.side * (x - foam.position))
        pull = 0.0
        if contact == PRESSING:
            pull = elastic * (1.0 + foam.loss * speed) + foam.damping * speed
        force = force - foam.side * pull
        lost = (pull - elastic) * speed
    return force / plant.mass, reference_rate * grip, plant.grip_damping * slip * slip, lost


def dormand_prince_substep(
    plant: PlantParams,
    foam: FoamParams,
    contact: int,
    outside: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
    t: float,
) -> Trial:
    """One step of order 5 over `t` [s] in one mode; `outside` is the effort less the friction.

    Returns
    -------
    tuple
        x, v, their estimated errors, then in J: hand work, grip loss, integral of v**2, contact
        loss.
    """
    r = reference_rate
    a1, p1, g1, c1 = _rates(plant, foam, contact, outside, reference, r, x, v)
    v2 = v + t * (0.2 * a1)
    x2 = x + t * (0.2 * v)
    a2, _, _, _ = _rates(plant, foam, contact, outside, reference + r * (0.2 * t), r, x2, v2)
    v3 = v + t * (0.075 * a1 + 0.225 * a2)
    x3 = x + t * (0.075 * v + 0.225 * v2)
    a3, p3, g3, c3 = _rates(plant, foam, contact, outside, reference + r * (0.3 * t), r, x3, v3)
    v4 = v + t * (44.0 / 45.0 * a1 - 56.0 / 15.0 * a2 + 32.0 / 9.0 * a3)
    x4 = x + t * (44.0 / 45.0 * v - 56.0 / 15.0 * v2 + 32.0 / 9.0 * v3)
    a4, p4, g4, c4 = _rates(plant, foam, contact, outside, reference + r * (0.8 * t), r, x4, v4)
    v5 = v + t * (
        19372.0 / 6561.0 * a1 - 25360.0 / 2187.0 * a2 + 64448.0 / 6561.0 * a3 - 212.0 / 729.0 * a4
    )
    x5 = x + t * (
        19372.0 / 6561.0 * v - 25360.0 / 2187.0 * v2 + 64448.0 / 6561.0 * v3 - 212.0 / 729.0 * v4
    )
    at = reference + r * (8.0 / 9.0 * t)
    a5, p5, g5, c5 = _rates(plant, foam, contact, outside, at, r, x5, v5)
    v6 = v + t * (
        9017.0 / 3168.0 * a1
        - 355.0 / 33.0 * a2
        + 46732.0 / 5247.0 * a3
        + 49.0 / 176.0 * a4
        - 5103.0 / 18656.0 * a5
    )
    x6 = x + t * (
        9017.0 / 3168.0 * v
        - 355.0 / 33.0 * v2
        + 46732.0 / 5247.0 * v3
        + 49.0 / 176.0 * v4
        - 5103.0 / 18656.0 * v5
    )
    end = reference + r * t
    a6, p6, g6, c6 = _rates(plant, foam, contact, outside, end, r, x6, v6)
    b1 = 35.0 / 384.0 * t
    b3 = 500.0 / 1113.0 * t
    b4 = 125.0 / 192.0 * t
    b5 = -2187.0 / 6784.0 * t
    b6 = 11.0 / 84.0 * t
    v7 = v + (b1 * a1 + b3 * a3 + b4 * a4 + b5 * a5 + b6 * a6)
    x7 = x + (b1 * v + b3 * v3 + b4 * v4 + b5 * v5 + b6 * v6)
    a7, _, _, _ = _rates(plant, foam, contact, outside, end, r, x7, v7)
    e1 = 71.0 / 57600.0 * t
    e3 = -71.0 / 16695.0 * t
    e4 = 71.0 / 1920.0 * t
    e5 = -17253.0 / 339200.0 * t
    e6 = 22.0 / 525.0 * t
    e7 = -0.025 * t
    return (
        x7,
        v7,
        e1 * v + e3 * v3 + e4 * v4 + e5 * v5 + e6 * v6 + e7 * v7,
        e1 * a1 + e3 * a3 + e4 * a4 + e5 * a5 + e6 * a6 + e7 * a7,
        b1 * p1 + b3 * p3 + b4 * p4 + b5 * p5 + b6 * p6,
        b1 * g1 + b3 * g3 + b4 * g4 + b5 * g5 + b6 * g6,
        b1 * v * v + b3 * v3 * v3 + b4 * v4 * v4 + b5 * v5 * v5 + b6 * v6 * v6,
        b1 * c1 + b3 * c3 + b4 * c4 + b5 * c5 + b6 * c6,
    )


def _force_size(
    plant: PlantParams, foam: FoamParams, effort: float, reference: float, x: float
) -> float:
    """Sum of the sizes of the forces at rest [N or N m]."""
    size = math.fabs(effort) + plant.grip_stiffness * math.fabs(reference - x)
    size = size + elastic_force(foam, foam.side * (x - foam.position))
    if plant.spring_stiffness > 0.0:
        size = size + plant.spring_stiffness * math.fabs(x - plant.spring_position)
    return size + plant.coulomb


def _locate(
    plant: PlantParams,
    foam: FoamParams,
    contact: int,
    direction: float,
    edge: int,
    outside: float,
    reference: float,
    reference_rate: float,
    x: float,
    v: float,
    t: float,
) -> float:
    """Time at which a step from (x, v) reaches an edge that lies within `t` [s]; Illinois."""
    low = 0.0
    high = t
    g_low = edge_level(foam, contact, direction, edge, x, v)
    part = t
    for _ in range(_BISECTIONS):
        if g_low < 0.0:
            break
        # It starts on the edge: either it crosses now, or it leaves and comes back within t.
        part = 0.25 * part
        xe, ve, _, _, _, _, _, _ = dormand_prince_substep(
            plant, foam, contact, outside, reference, reference_rate, x, v, part
        )
        g_low = edge_level(foam, contact, direction, edge, xe, ve)
        low = part
    if not g_low < 0.0:
        return 0.0
    xe, ve, _, _, _, _, _, _ = dormand_prince_substep(
        plant, foam, contact, outside, reference, reference_rate, x, v, t
    )
    g_high = edge_level(foam, contact, direction, edge, xe, ve)
    side = 0
    at = high
    for i in range(_BISECTIONS):
        at = 0.5 * (low + high)
        if i % 8 != 7 and g_high > g_low:
            at = high - g_high * (high - low) / (g_high - g_low)
            if not (low < at < high):
                at = 0.5 * (low + high)
        xe, ve, _, _, _, _, _, _ = dormand_prince_substep(
            plant, foam, contact, outside, reference, reference_rate, x, v, at
        )
        g = edge_level(foam, contact, direction, edge, xe, ve)
        if g == 0.0:
            return at
        if g < 0.0:
            low = at
            g_low = g
            if side == -1:
                g_high = 0.5 * g_high
            side = -1
        else:
            high = at
            g_high = g
            if side == 1:
                g_low = 0.5 * g_low
            side = 1
        if high - low <= 2.5e-16 * high:
            break
    return high


def dormand_prince_step(
    plant: PlantParams,
    foam: FoamParams,
    x: float,
    v: float,
    effort: float,
    reference: float,
    reference_rate: float,
    h: float,
) -> FoamStep:
    """Move a plant at a contact on by `h` [s] within `foam.tolerance` a step; as `foam_step`.

    Returns
    -------
    tuple
        x, v, then in J: hand work, grip loss, viscous loss, Coulomb loss, environment loss.
    """
    hand_work = 0.0
    grip_loss = 0.0
    square = 0.0
    coulomb_loss = 0.0
    environment_loss = 0.0
    tolerance = foam.tolerance
    if tolerance < _ROUNDING:
        tolerance = _ROUNDING
    elapsed = 0.0
    pushed = 0.0
    t = h
    contact = contact_now(foam, foam.side * (x - foam.position), foam.side * v)
    for _ in range(_TRIALS):
        remaining = h - elapsed
        if not remaining > 0.0:
            break
        aim = reference + reference_rate * elapsed
        direction = 0.0
        if plant.coulomb > 0.0:
            if v > 0.0:
                direction = 1.0
            elif v < 0.0:
                direction = -1.0
            else:
                a, _, _, _ = _rates(plant, foam, contact, effort, aim, reference_rate, x, v)
                if pushed != 0.0:
                    direction = pushed
                elif plant.mass * a > plant.coulomb:
                    direction = 1.0
                elif plant.mass * a < -plant.coulomb:
                    direction = -1.0
                else:
                    # It rests until the moving grip has stretched enough.
                    dwell = remaining
                    slope = plant.grip_stiffness * reference_rate
                    if slope > 0.0 and plant.coulomb - plant.mass * a < slope * remaining:
                        dwell = (plant.coulomb - plant.mass * a) / slope
                        pushed = 1.0
                    elif slope < 0.0 and -plant.coulomb - plant.mass * a > slope * remaining:
                        dwell = (-plant.coulomb - plant.mass * a) / slope
                        pushed = -1.0
                    grip = plant.grip_stiffness * (aim - x + 0.5 * reference_rate * dwell)
                    grip = grip + plant.grip_damping * reference_rate
                    hand_work = hand_work + reference_rate * dwell * grip
                    spread = reference_rate * reference_rate * dwell
                    grip_loss = grip_loss + plant.grip_damping * spread
                    elapsed = elapsed + dwell
                    if pushed == 0.0:
                        break
                    continue
        pushed = 0.0
        outside = effort - plant.coulomb * direction
        if t > remaining:
            t = remaining
        a, _, _, _ = _rates(plant, foam, contact, outside, aim, reference_rate, x, v)
        xe, ve, ex, ev, work, grip, squared, lost = dormand_prince_substep(
            plant, foam, contact, outside, aim, reference_rate, x, v, t
        )
        fast = math.fabs(v)
        if math.fabs(ve) > fast:
            fast = math.fabs(ve)
        fast = fast + math.fabs(a) * t
        # At rest the difference of balanced forces is rounding, and so is its error estimate.
        fast = fast + _NOISE / tolerance * t * _force_size(plant, foam, effort, aim, x) / plant.mass
        error = 0.0
        if fast > 0.0:
            error = math.fabs(ev) / fast
            if math.fabs(ex) > error * fast * t:
                error = math.fabs(ex) / (fast * t)
        # Not below: a NaN is refused until the smallest step, and then seen by all.
        if not error <= tolerance and t > _SMALLEST * h:
            shrink = 0.1
            if error > 0.0:
                shrink = _SAFETY * math.pow(tolerance / error, 0.2)
                if not shrink > 0.1:
                    shrink = 0.1
            t = shrink * t
            continue
        depth = foam.side * (x - foam.position)
        deep = foam.side * (xe - foam.position)
        speed = foam.side * v
        turning = contact == FREE and speed > 0.0 and foam.side * ve < 0.0
        near = depth + 0.5 * speed * t > 0.0 or deep - 0.5 * foam.side * ve * t > 0.0
        if turning and near and deep < 0.0 and t > _SMALLEST * h:
            t = 0.5 * t  # an in-and-out may hide between the ends
            continue
        first = -1
        when = t
        for edge in range(3):
            seen = edge == 2 and direction != 0.0
            if edge == 0:
                seen = True
            elif edge == 1:
                seen = contact != FREE and (foam.damping > 0.0 or foam.loss > 0.0)
            if seen and edge_level(foam, contact, direction, edge, xe, ve) > 0.0:
                at = _locate(
                    plant, foam, contact, direction, edge, outside, aim, reference_rate, x, v, t
                )
                if first < 0 or at < when:
                    first = edge
                    when = at
        if first >= 0:
            xe, ve, _, _, work, grip, squared, lost = dormand_prince_substep(
                plant, foam, contact, outside, aim, reference_rate, x, v, when
            )
        else:
            grow = 5.0
            if error > tolerance:
                grow = 2.0  # the smallest step there is; the next may be longer
            elif error > 0.0:
                grow = _SAFETY * math.pow(tolerance / error, 0.2)
                if grow > 5.0:
                    grow = 5.0
            when = t
            t = grow * t
        hand_work = hand_work + work
        grip_loss = grip_loss + grip
        square = square + squared
        environment_loss = environment_loss + lost
        coulomb_loss = coulomb_loss + plant.coulomb * direction * (xe - x)
        x = xe
        v = ve
        elapsed = elapsed + when
        if first == 0:
            x = foam.position
            if contact == FREE:
                contact = PRESSING
            else:
                contact = FREE
        elif first == 1:
            if contact == PRESSING:
                contact = CLIPPED
            else:
                contact = PRESSING
        elif first == 2:
            v = 0.0
    if elapsed < (1.0 - 1e-9) * h and pushed == 0.0 and v != 0.0:
        # Chatter, or numbers that have overflowed: passive and finite, as in `switching_step`.
        environment_loss = environment_loss + 0.5 * plant.mass * v * v
        v = 0.0
    return x, v, hand_work, grip_loss, plant.viscous * square, coulomb_loss, environment_loss
