"""First instant at which a linear function of a linear motion rises above zero.

`g(t) = start + alpha (x(t) - x(0)) + beta (v(t) - v(0))` along `m a + b v + k x = f + s t`. Its
second derivative solves the homogeneous equation and so has at most one zero within half an
oscillation; that zero splits g' into two monotone pieces, whose zeros split g into three. Every
piece is searched by a bracketed Newton iteration, so an in-and-out cannot be missed.
"""

from __future__ import annotations

import math

from tautwave.models.linear import flow_increment
from tautwave.models.plant_params import greatest_response

_ITERATIONS = 200
_HALVINGS = 40
_ISOLATION = 2.5  # radians of the damped oscillation; at most one zero needs less than pi


def isolation_limit(stiffness: float, damping: float, mass: float, span: float) -> float:
    """Longest time, at most `span` [s], over which `first_rise` sees every rise."""
    square = stiffness / mass - 0.25 * (damping / mass) * (damping / mass)
    if square > 0.0:
        limit = _ISOLATION / math.sqrt(square)
        if limit < span:
            return limit
    return span


def motion_bounds(
    stiffness: float, damping: float, mass: float, v: float, net: float, slope: float, t: float
) -> tuple[float, float, float, float]:
    """Bounds over the next `t` [s]: least and greatest change of x, least and greatest v."""
    fabs_net = math.fabs(net) + t * math.fabs(slope)
    speed = math.fabs(v) + greatest_response(stiffness, damping, mass, t) * fabs_net
    low = -t * speed
    high = t * speed
    slowest = -speed
    fastest = speed
    # The net force changes by no more than the springs and the slope allow.
    change = t * (fabs_net / mass + math.sqrt(stiffness / mass) * math.fabs(v))
    if v - change > slowest:
        slowest = v - change
    if v + change < fastest:
        fastest = v + change
    if stiffness > 0.0:
        # Around the moving equilibrium the energy of the motion cannot grow.
        drift = slope / stiffness
        away = -(net + damping * (v - drift)) / stiffness
        rate = math.sqrt(stiffness / mass)
        swing = math.sqrt(away * away + (v - drift) * (v - drift) / (rate * rate))
        shift = drift * t
        least = -swing - away
        greatest = swing - away
        if shift < 0.0:
            least = least + shift
        else:
            greatest = greatest + shift
        if least > low:
            low = least
        if greatest < high:
            high = greatest
        if drift - rate * swing > slowest:
            slowest = drift - rate * swing
        if drift + rate * swing < fastest:
            fastest = drift + rate * swing
    return low, high, slowest, fastest


def _rise(
    stiffness: float,
    damping: float,
    mass: float,
    v: float,
    net: float,
    slope: float,
    alpha: float,
    beta: float,
    start: float,
    t: float,
) -> tuple[float, float, float, float]:
    """Return g and its first three derivatives at `t`."""
    moved, now, force = flow_increment(stiffness, damping, mass, v, net, slope, t)
    a = force / mass
    jerk = (slope - stiffness * now - damping * a) / mass
    snap = -(stiffness * a + damping * jerk) / mass
    return (
        start + alpha * moved + beta * (now - v),
        alpha * now + beta * a,
        alpha * a + beta * jerk,
        alpha * jerk + beta * snap,
    )


def _zero(
    stiffness: float,
    damping: float,
    mass: float,
    v: float,
    net: float,
    slope: float,
    alpha: float,
    beta: float,
    start: float,
    order: int,
    left: float,
    right: float,
    left_negative: bool,
) -> float:
    """Zero of the derivative of `order` between two times at which its sign differs."""
    low = left
    high = right
    t = 0.5 * (low + high)
    for i in range(_ITERATIONS):
        g, g1, g2, g3 = _rise(stiffness, damping, mass, v, net, slope, alpha, beta, start, t)
        if order == 1:
            g = g1
            g1 = g2
        elif order == 2:
            g = g2
            g1 = g3
        if g == 0.0:
            return t
        if (g < 0.0) == left_negative:
            low = t
        else:
            high = t
        middle = 0.5 * (low + high)
        following = middle
        if g1 != 0.0 and i % 8 != 7:
            following = t - g / g1
            if not (low < following < high):
                following = middle
        if math.fabs(following - t) <= 2.5e-16 * t:
            return following
        t = following
    return t


def first_rise(
    stiffness: float,
    damping: float,
    mass: float,
    v: float,
    net: float,
    slope: float,
    alpha: float,
    beta: float,
    start: float,
    span: float,
) -> float:
    """First time in [0, span] at which g, rising, reaches zero, or -1 if it never does.

    A g that starts above zero counts as above by rounding if it falls first, and as risen at 0
    if it rises. `span` must not exceed `isolation_limit`.
    """
    at0, d0, c0, _ = _rise(stiffness, damping, mass, v, net, slope, alpha, beta, start, 0.0)
    at1, d1, c1, _ = _rise(stiffness, damping, mass, v, net, slope, alpha, beta, start, span)
    middle = span
    d_middle = d1
    if (c0 < 0.0 and c1 > 0.0) or (c0 > 0.0 and c1 < 0.0):
        middle = _zero(
            stiffness, damping, mass, v, net, slope, alpha, beta, start, 2, 0.0, span, c0 < 0.0
        )
        _, d_middle, _, _ = _rise(
            stiffness, damping, mass, v, net, slope, alpha, beta, start, middle
        )
    first = 0.0
    if (d0 < 0.0 and d_middle > 0.0) or (d0 > 0.0 and d_middle < 0.0):
        first = _zero(
            stiffness, damping, mass, v, net, slope, alpha, beta, start, 1, 0.0, middle, d0 < 0.0
        )
    second = span
    if (d_middle < 0.0 and d1 > 0.0) or (d_middle > 0.0 and d1 < 0.0):
        second = _zero(
            stiffness,
            damping,
            mass,
            v,
            net,
            slope,
            alpha,
            beta,
            start,
            1,
            middle,
            span,
            d_middle < 0.0,
        )
    left = 0.0
    g_left = at0
    for piece in range(3):
        right = first
        if piece == 1:
            right = second
        elif piece == 2:
            right = span
        if right > left:
            g_right = at1
            if right < span:
                g_right, _, _, _ = _rise(
                    stiffness, damping, mass, v, net, slope, alpha, beta, start, right
                )
            if g_right > 0.0 and g_right > g_left:
                if g_left >= 0.0:
                    if left > 0.0 or not (d0 < 0.0 or (d0 == 0.0 and c0 < 0.0)):
                        return left
                    # It falls first, but its turn drowns in rounding: find where it is below.
                    below = right
                    for _ in range(_HALVINGS):
                        below = 0.25 * below
                        g_left, _, _, _ = _rise(
                            stiffness, damping, mass, v, net, slope, alpha, beta, start, below
                        )
                        if g_left < 0.0:
                            break
                    if g_left >= 0.0:
                        return left  # below for less than a float can tell from now
                    left = below
                return _zero(
                    stiffness,
                    damping,
                    mass,
                    v,
                    net,
                    slope,
                    alpha,
                    beta,
                    start,
                    0,
                    left,
                    right,
                    True,
                )
            left = right
            g_left = g_right
    return -1.0
