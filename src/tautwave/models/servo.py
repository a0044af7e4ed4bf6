"""Admittance-axis plant: a drive whose velocity follows its command with a first-order lag.

The drive is as strong as it needs to be; the hand's mass rides on it, its grip and the
environment load it, and what they do on the device is what a force sensor measures.
"""

from __future__ import annotations

import math
from typing import NamedTuple

_STRETCHES = 16  # a lag has a handful of events at most; the last stretch looks for none


class ServoParams(NamedTuple):
    """Lag of the drive [s, >= 0], hand and environment; the rest as in `PlantParams`."""

    time_constant: float
    hand_mass: float
    grip_stiffness: float
    grip_damping: float
    spring_stiffness: float
    spring_position: float
    wall_stiffness: float
    wall_damping: float
    wall_position: float
    wall_side: float


def lag_integrals(t: float, time_constant: float) -> tuple[float, float, float, float]:
    """Return e = exp(-t/tau), the integrals of e and of its integral, and that of e**2."""
    if not time_constant > 0.0:
        return 0.0, 0.0, 0.0, 0.0
    r = t / time_constant
    if r > 0.5:
        decay = math.exp(-r)
        first = time_constant * (1.0 - decay)
        return decay, first, time_constant * (t - first), 0.5 * first * (1.0 + decay)
    term = 1.0
    lost = 0.0
    first = 1.0
    second = 0.5
    for i in range(1, 18):
        term = -term * r / i
        lost = lost + term
        first = first + term / (i + 1.0)
        second = second + term / ((i + 1.0) * (i + 2.0))
    first = first * t
    return 1.0 + lost, first, second * t * t, 0.5 * first * (2.0 + lost)


def _level(
    p: ServoParams,
    command: float,
    lead: float,
    alpha: float,
    beta: float,
    start: float,
    t: float,
) -> tuple[float, float]:
    """Value and slope at `t` of `start + alpha dx + beta dv`; `lead` is v(0) - command."""
    decay, first, _, _ = lag_integrals(t, p.time_constant)
    speed = command + lead * decay
    rate = 0.0
    gained = 0.0
    if p.time_constant > 0.0:
        rate = -lead * decay / p.time_constant
        gained = -lead * first / p.time_constant
    return start + alpha * (command * t + lead * first) + beta * gained, alpha * speed + beta * rate


def _rise_time(
    p: ServoParams,
    command: float,
    lead: float,
    alpha: float,
    beta: float,
    start: float,
    span: float,
) -> float:
    """First time in [0, span] at which the level, rising, reaches zero; -1 if never."""
    # The slope is a constant and one exponential: at most one turning point.
    turn = span
    if p.time_constant > 0.0:
        steady = alpha * command
        fading = (alpha - beta / p.time_constant) * lead
        if (steady > 0.0 and fading < -steady) or (steady < 0.0 and fading > -steady):
            instant = p.time_constant * math.log(-fading / steady)
            if instant < span:
                turn = instant
    low = 0.0
    g_low = start
    for piece in range(2):
        high = turn
        if piece == 1:
            high = span
        if high > low:
            g_high, _ = _level(p, command, lead, alpha, beta, start, high)
            if g_high > 0.0 and g_high > g_low:
                if g_low >= 0.0:
                    return low
                t = 0.5 * (low + high)
                for i in range(200):
                    g, slope = _level(p, command, lead, alpha, beta, start, t)
                    if g == 0.0:
                        break
                    if g < 0.0:
                        low = t
                    else:
                        high = t
                    following = 0.5 * (low + high)
                    if slope > 0.0 and i % 8 != 7:
                        newton = t - g / slope
                        if low < newton < high:
                            following = newton
                    change = math.fabs(following - t)
                    t = following
                    if change <= 2.5e-16 * t:
                        break
                return t
            low = high
            g_low = g_high
    return -1.0


def _wall_event(
    p: ServoParams, contact: int, depth: float, v: float, command: float, span: float
) -> tuple[float, int]:
    """Time of the next change of contact (0 free, 1 pressing, 2 clipped) and what comes then."""
    side = p.wall_side
    lead = v - command
    push = p.wall_stiffness * depth + p.wall_damping * side * v
    stiff = side * p.wall_stiffness
    sticky = side * p.wall_damping
    if contact == 0:
        t = _rise_time(p, command, lead, side, 0.0, depth, span)
        if t >= 0.0:
            return t, 1
    elif contact == 1:
        t = _rise_time(p, command, lead, -stiff, -sticky, -push, span)
        if t >= 0.0:
            return t, 2
    else:
        t = _rise_time(p, command, lead, -side, 0.0, -depth, span)
        again = _rise_time(p, command, lead, stiff, sticky, push, span)
        if again >= 0.0 and (t < 0.0 or again < t):
            return again, 1
        if t >= 0.0:
            return t, 0
    return span, contact


def servo_step(
    p: ServoParams,
    x: float,
    v: float,
    command: float,
    reference: float,
    reference_rate: float,
    h: float,
) -> tuple[float, float, float, float, float, float]:
    """Move the drive on by `h` [s] under a constant velocity `command`.

    Returns
    -------
    tuple
        x, v, then over the step in J: work of the reference on the grip, losses of grip and
        environment, and the work of the outside (grip, environment, inertia of the hand) on the
        device. `hand_work = outside_work + d stored + losses` up to rounding, with the wall's
        entry and exit located; each is an integral of its own.
    """
    if not p.time_constant > 0.0:
        # Without lag the velocity jumps now; the hand's mass has to follow at once.
        outside_work = -0.5 * p.hand_mass * (command - v) * (command + v)
        v = command
    else:
        outside_work = 0.0
    hand_work = 0.0
    grip_loss = 0.0
    environment_loss = 0.0
    walled = p.wall_stiffness > 0.0 or p.wall_damping > 0.0
    contact = 0
    if walled:
        depth = p.wall_side * (x - p.wall_position)
        speed = p.wall_side * v
        if depth > 0.0 or (depth == 0.0 and speed > 0.0):
            contact = 1
            if p.wall_stiffness * depth + p.wall_damping * speed < 0.0:
                contact = 2
    remaining = h
    for stretch in range(_STRETCHES):
        span = remaining
        following = contact
        depth = p.wall_side * (x - p.wall_position)
        if walled and stretch < _STRETCHES - 1:
            span, following = _wall_event(p, contact, depth, v, command, remaining)
        decay, first, second, squared = lag_integrals(span, p.time_constant)
        lead = v - command
        moved = command * span + lead * first
        area = 0.5 * command * span * span + lead * second
        square = command * (command * span + 2.0 * lead * first) + lead * lead * squared
        if p.grip_stiffness > 0.0 or p.grip_damping > 0.0:
            ahead = reference - x
            swept = reference_rate * span
            slipped = swept - moved
            grip = p.grip_stiffness * (span * (ahead + 0.5 * swept) - area)
            grip = grip + p.grip_damping * slipped
            hand_work = hand_work + reference_rate * grip
            pull = moved * (ahead - 0.5 * moved) + reference_rate * (span * moved - area)
            outside_work = (
                outside_work
                + p.grip_stiffness * pull
                + p.grip_damping * (reference_rate * moved - square)
            )
            grip_loss = grip_loss + p.grip_damping * (square + reference_rate * (slipped - moved))
        if p.spring_stiffness > 0.0:
            outside_work = outside_work - p.spring_stiffness * moved * (
                x - p.spring_position + 0.5 * moved
            )
        if contact != 0:
            sunk = p.wall_side * moved
            if following == 0:
                sunk = -depth
            stored = p.wall_stiffness * sunk * (depth + 0.5 * sunk)
            if contact == 1:
                loss = p.wall_damping * square
                environment_loss = environment_loss + loss
                outside_work = outside_work - stored - loss
            else:
                environment_loss = environment_loss - stored
        now = command + lead * decay
        outside_work = outside_work - 0.5 * p.hand_mass * (now - v) * (now + v)
        x = x + moved
        v = now
        remaining = remaining - span
        reference = reference + reference_rate * span
        if following == contact:
            break
        if following == 0 or contact == 0:
            x = p.wall_position
        contact = following
    return x, v, hand_work, grip_loss, environment_loss, outside_work


def servo_stored(
    p: ServoParams, x: float, v: float, reference: float
) -> tuple[float, float, float]:
    """Stored energy [J]: kinetic of the hand, in the grip's spring, in the environment's."""
    environment = 0.0
    if p.spring_stiffness > 0.0:
        stretch = x - p.spring_position
        environment = 0.5 * p.spring_stiffness * stretch * stretch
    depth = p.wall_side * (x - p.wall_position)
    if depth > 0.0:
        environment = environment + 0.5 * p.wall_stiffness * depth * depth
    ahead = reference - x
    return 0.5 * p.hand_mass * v * v, 0.5 * p.grip_stiffness * ahead * ahead, environment


def servo_forces(
    p: ServoParams,
    x: float,
    v: float,
    command: float,
    reference: float,
    reference_rate: float,
) -> tuple[float, float]:
    """Force of the hand (grip less inertia) and of the environment on the device, along x."""
    hand = p.grip_stiffness * (reference - x) + p.grip_damping * (reference_rate - v)
    if p.time_constant > 0.0:
        hand = hand - p.hand_mass * (command - v) / p.time_constant
    environment = 0.0
    if p.spring_stiffness > 0.0:
        environment = -p.spring_stiffness * (x - p.spring_position)
    depth = p.wall_side * (x - p.wall_position)
    if depth > 0.0:
        push = p.wall_stiffness * depth + p.wall_damping * p.wall_side * v
        if push > 0.0:
            environment = environment - p.wall_side * push
    return hand, environment
