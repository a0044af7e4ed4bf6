"""A plant step that finds every change of contact and friction inside the step.

The motion is linear between events: contact free / pressing / clipped (the wall would have to
pull, so it lets go) times sliding up / sliding down / stuck. Each stretch ends at the first event
or at the end of the step, and every loss comes from its own integral over the stretch.
"""

from __future__ import annotations

import math

from tautwave.models.crossing import first_rise, isolation_limit, motion_bounds
from tautwave.models.linear import FlowCoefficients, flow_coefficients
from tautwave.models.plant_params import FlowCache, PlantCache, PlantParams

FREE = 0
PRESSING = 1
CLIPPED = 2
SLIDING_UP = 3
SLIDING_DOWN = 6
STUCK = 9
_STRETCHES = 2000
_DECAYS = 25.0  # time constants of the damping searched at once after an event

PlantStep = tuple[float, float, int, float, float, float, float, float]


def contact_mode(p: PlantParams, mode: int, depth: float, v: float) -> int:
    """Return FREE, PRESSING or CLIPPED at a penetration `depth` [rad or m].

    `mode` is that of the step before; it decides only where rounding hides which side it is.
    """
    if depth < 0.0:
        return FREE
    speed = p.wall_side * v
    if depth == 0.0:
        if speed > 0.0:
            return PRESSING
        return FREE
    push = p.wall_stiffness * depth
    drag = p.wall_damping * speed
    if math.fabs(push + drag) <= 1e-12 * (push + math.fabs(drag)):
        if mode % 3 == CLIPPED:
            return CLIPPED
        return PRESSING
    if push + drag > 0.0:
        return PRESSING
    return CLIPPED


def _next_event(
    p: PlantParams,
    contact: int,
    direction: float,
    stiffness: float,
    damping: float,
    x: float,
    v: float,
    net: float,
    slope: float,
    remaining: float,
    patience: float,
) -> tuple[float, int]:
    """Time of the next event and which (0 none, 1 contact, 2 exit while clipped, 3 stop).

    `patience` is the longest search in units of the damping's time m/b.
    """
    depth = p.wall_side * (x - p.wall_position)
    limit = isolation_limit(stiffness, damping, p.mass, remaining)
    if damping * limit > patience * p.mass:
        limit = patience * p.mass / damping
    walled = p.wall_stiffness > 0.0 or p.wall_damping > 0.0
    span = remaining
    near = False
    turning = False
    for _ in range(100):
        low, high, slowest, fastest = motion_bounds(stiffness, damping, p.mass, v, net, slope, span)
        if p.wall_side < 0.0:
            rise = -low
            fall = -high
            withdrawal = -fastest
        else:
            rise = high
            fall = low
            withdrawal = slowest
        near = contact == CLIPPED
        if walled:
            if contact == FREE:
                near = not depth + rise < 0.0
            elif contact == PRESSING:
                near = not (
                    depth + fall > 0.0
                    and p.wall_stiffness * (depth + fall) + p.wall_damping * withdrawal > 0.0
                )
        turning = (direction > 0.0 and not slowest > 0.0) or (direction < 0.0 and not fastest < 0.0)
        if span <= limit or not (near or turning):
            break
        span = 0.5 * span
    when = span
    what = 0
    side = p.wall_side
    if near and contact == FREE:
        t = first_rise(stiffness, damping, p.mass, v, net, slope, side, 0.0, depth, when)
        if t >= 0.0:
            when = t
            what = 1
    elif near and contact == PRESSING:
        k = -side * p.wall_stiffness
        b = -side * p.wall_damping
        g = -p.wall_stiffness * depth + b * v
        t = first_rise(stiffness, damping, p.mass, v, net, slope, k, b, g, when)
        if t >= 0.0:
            when = t
            what = 1
    elif near:
        k = side * p.wall_stiffness
        b = side * p.wall_damping
        g = p.wall_stiffness * depth + b * v
        t = first_rise(stiffness, damping, p.mass, v, net, slope, k, b, g, when)
        if t >= 0.0:
            when = t
            what = 1
        t = first_rise(stiffness, damping, p.mass, v, net, slope, -side, 0.0, -depth, when)
        if t >= 0.0 and (what == 0 or t < when):
            when = t
            what = 2
    if turning:
        t = first_rise(
            stiffness, damping, p.mass, v, net, slope, 0.0, -direction, -direction * v, when
        )
        if t >= 0.0 and (what == 0 or t < when):
            when = t
            what = 3
    return when, what


def _coefficients(p: PlantParams, flow: FlowCache, step: float, span: float) -> FlowCoefficients:
    """`flow_coefficients` over `span`; those of a whole step are in the cache."""
    if span != step:
        return flow_coefficients(flow.stiffness, flow.damping, p.mass, span)
    return (
        flow.xv,
        flow.xn,
        flow.xs,
        flow.vv,
        flow.vn,
        flow.vs,
        flow.av,
        flow.an,
        flow.as_,
        flow.qvv,
        flow.qvn,
        flow.qvs,
        flow.qnn,
        flow.qns,
        flow.qss,
    )


def switching_step(
    p: PlantParams,
    c: PlantCache,
    contact: int,
    x: float,
    v: float,
    effort: float,
    reference: float,
    reference_rate: float,
    h: float,
) -> PlantStep:
    """`plant_step` with events; `contact` is the contact at the start.

    After 2000 stretches in one step (chatter, or numbers that have overflowed) the mass is held
    where it is for the rest of the step and its kinetic energy is booked as lost, to friction if
    there is any, else to the environment: passive and finite.
    """
    hand_work = 0.0
    grip_loss = 0.0
    viscous_loss = 0.0
    coulomb_loss = 0.0
    environment_loss = 0.0
    elapsed = 0.0
    pushed = 0.0
    patience = _DECAYS
    friction = 0
    slope = p.grip_stiffness * reference_rate
    finished = False
    for _ in range(_STRETCHES):
        remaining = h - elapsed
        ahead = reference + reference_rate * elapsed - x
        stiffness = c.free.stiffness
        damping = c.free.damping
        force = (
            effort
            + p.grip_stiffness * ahead
            + p.grip_damping * (reference_rate - v)
            - p.viscous * v
        )
        if p.spring_stiffness > 0.0:
            force = force - p.spring_stiffness * (x - p.spring_position)
        if contact == PRESSING:
            stiffness = c.pressing.stiffness
            damping = c.pressing.damping
            force = force - (p.wall_stiffness * (x - p.wall_position) + p.wall_damping * v)
        direction = 0.0
        if p.coulomb > 0.0:
            friction = STUCK
            if v > 0.0:
                direction = 1.0
            elif v < 0.0:
                direction = -1.0
            elif pushed != 0.0:
                direction = pushed
            elif force > p.coulomb:
                direction = 1.0
            elif force < -p.coulomb:
                direction = -1.0
            pushed = 0.0
            if direction == 0.0:
                dwell = remaining
                if slope > 0.0 and (p.coulomb - force) < slope * remaining:
                    dwell = (p.coulomb - force) / slope
                    pushed = 1.0
                elif slope < 0.0 and (-p.coulomb - force) > slope * remaining:
                    dwell = (-p.coulomb - force) / slope
                    pushed = -1.0
                grip = p.grip_stiffness * (ahead + 0.5 * reference_rate * dwell)
                grip = grip + p.grip_damping * reference_rate
                hand_work = hand_work + reference_rate * dwell * grip
                grip_loss = grip_loss + p.grip_damping * reference_rate * reference_rate * dwell
                if pushed == 0.0:
                    finished = True
                    break
                elapsed = elapsed + dwell
                continue
            friction = SLIDING_UP
            if direction < 0.0:
                friction = SLIDING_DOWN
            force = force - p.coulomb * direction
            if v == 0.0 and force * direction < 0.0:
                force = 0.0
        span, event = _next_event(
            p, contact, direction, stiffness, damping, x, v, force, slope, remaining, patience
        )
        # A fast decay hides slow turns in its rounding: look closely after an event only.
        patience = 4.0 * patience
        if event != 0:
            patience = _DECAYS
        if span > 0.0:
            if contact == PRESSING:
                xv, xn, xs, vv, vn, vs, av, an, as_, qvv, qvn, qvs, qnn, qns, qss = _coefficients(
                    p, c.pressing, c.step, span
                )
            else:
                xv, xn, xs, vv, vn, vs, av, an, as_, qvv, qvn, qvs, qnn, qns, qss = _coefficients(
                    p, c.free, c.step, span
                )
            moved = xv * v + xn * force + xs * slope
            area = av * v + an * force + as_ * slope
            square = (
                v * (qvv * v + qvn * force + qvs * slope)
                + force * (qnn * force + qns * slope)
                + qss * slope * slope
            )
            swept = reference_rate * span
            grip = p.grip_stiffness * (span * (ahead + 0.5 * swept) - area)
            grip = grip + p.grip_damping * (swept - moved)
            hand_work = hand_work + reference_rate * grip
            grip_loss = grip_loss + p.grip_damping * (
                square + reference_rate * (swept - 2.0 * moved)
            )
            viscous_loss = viscous_loss + p.viscous * square
            if direction != 0.0:
                coulomb_loss = coulomb_loss + p.coulomb * direction * moved
            if contact == PRESSING:
                environment_loss = environment_loss + p.wall_damping * square
            elif contact == CLIPPED:
                # The wall creeps back on its own: its spring works against its damper only.
                depth = p.wall_side * (x - p.wall_position)
                gone = -p.wall_side * moved
                if event == 2:
                    gone = depth
                environment_loss = environment_loss + p.wall_stiffness * gone * (depth - 0.5 * gone)
            x = x + moved
            v = v + (vv * v + vn * force + vs * slope)
        if event == 0 and not span < remaining:
            finished = True
            break
        elapsed = elapsed + span
        if event == 1:
            if contact == FREE:
                x = p.wall_position
                contact = PRESSING
            elif contact == CLIPPED:
                contact = PRESSING
            elif p.wall_damping > 0.0:
                contact = CLIPPED
            else:
                x = p.wall_position
                contact = FREE
        elif event == 2:
            x = p.wall_position
            contact = FREE
        elif event == 3:
            v = 0.0
    if not finished:
        lost = 0.5 * p.mass * v * v
        if p.coulomb > 0.0:
            coulomb_loss = coulomb_loss + lost
        else:
            environment_loss = environment_loss + lost
        v = 0.0
        remaining = h - elapsed
        ahead = reference + reference_rate * elapsed - x
        swept = reference_rate * remaining
        grip = p.grip_stiffness * (ahead + 0.5 * swept) + p.grip_damping * reference_rate
        hand_work = hand_work + swept * grip
        grip_loss = grip_loss + p.grip_damping * reference_rate * swept
    return (
        x,
        v,
        contact + friction,
        hand_work,
        grip_loss,
        viscous_loss,
        coulomb_loss,
        environment_loss,
    )
