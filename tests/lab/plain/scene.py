"""The textbook's wave-teleoperation scene: hand, master, wave line, slave, elastic wall.

Both devices move by closed forms under forces held for a period; meeting and leaving the wall are
located in closed form too, so that a step is exact to rounding. Written in the subset that plain
Python, numba and the translator to C share. It keeps no books: the difference to `simulate` is the
cost of everything else that does.
"""

from __future__ import annotations

import math
from collections.abc import MutableSequence, Sequence
from typing import NamedTuple

DELAY = 50
"""Periods that a wave is under way."""

_MEETINGS = 64


class Plain(NamedTuple):
    """One set of parameters, SI; all below `stiffness` follow from those above.

    `give` = T**2 / (2 m) and `gain` = T / m of a free mass; over a whole period in the wall, which
    turns the state by an angle a: `turn` = cos a - 1, `lever` = sin(a) / rate, `swing` = rate
    sin a; `slack` = m / k.
    """

    period: float
    impedance: float
    mass_1: float
    mass: float
    wall: float
    stiffness: float
    root: float
    give_1: float
    gain_1: float
    give: float
    gain: float
    rate: float
    turn: float
    lever: float
    swing: float
    slack: float


def plain_set(
    period: float, impedance: float, mass_1: float, mass: float, wall: float, stiffness: float
) -> Plain:
    """Return a set from what it depends on."""
    rate = math.sqrt(stiffness / mass)
    half = math.sin(0.5 * rate * period)
    swing = math.sin(rate * period)
    return Plain(
        period,
        impedance,
        mass_1,
        mass,
        wall,
        stiffness,
        math.sqrt(2.0 * impedance),
        0.5 * period * period / mass_1,
        period / mass_1,
        0.5 * period * period / mass,
        period / mass,
        rate,
        -2.0 * half * half,
        swing / rate,
        rate * swing,
        mass / stiffness,
    )


def meet_wall(p: Plain, x: float, v: float, force: float) -> tuple[float, float]:
    """Move the slave by a period in which it meets the wall, or leaves it, or both.

    On the way there its depth is a parabola, in the wall a sine; the first zero of either is the
    root of a quadratic equation (of the sine, for the tangent of half the angle), taken in the
    form without cancellation.
    """
    deep = x - p.wall
    left = p.period
    pull = force / p.mass
    rest = force / p.stiffness
    pressing = deep > 0.0
    for _ in range(_MEETINGS):
        when = -1.0
        if pressing:
            bend = 2.0 * rest - deep
            speed = v / p.rate
            square = speed * speed - bend * deep
            if square >= 0.0 and speed < 0.0:
                when = 2.0 * math.atan(deep / (math.sqrt(square) - speed)) / p.rate
            elif square >= 0.0 and bend < 0.0:
                when = 2.0 * math.atan((speed + math.sqrt(square)) / (-bend)) / p.rate
        else:
            square = v * v - 2.0 * pull * deep
            if square >= 0.0 and v > 0.0:
                when = -2.0 * deep / (v + math.sqrt(square))
            elif square >= 0.0 and pull > 0.0:
                when = (math.sqrt(square) - v) / pull
        met = 0.0 <= when < left
        span = left
        if met:
            span = when
        if pressing:
            half = math.sin(0.5 * p.rate * span)
            turn = -2.0 * half * half
            whole = math.sin(p.rate * span)
            off = deep - rest
            deep = deep + turn * off + v / p.rate * whole
            v = v + turn * v - p.rate * off * whole
        else:
            deep = deep + v * span + 0.5 * pull * span * span
            v = v + pull * span
        if not met:
            break
        left = left - span
        deep = 0.0
        pressing = not pressing
    return p.wall + deep, v


def plain_step(
    p: Plain,
    x1: float,
    v1: float,
    x2: float,
    v2: float,
    in1: float,
    in2: float,
    aim: float,
) -> tuple[float, float, float, float, float, float, float]:
    """Return both states a period later, the force on the master, and the leaving waves."""
    f1 = p.impedance * v1 - p.root * in1
    f2 = p.root * in2 - p.impedance * v2
    out1 = p.root * v1 - in1
    out2 = p.root * v2 - in2
    hand = 500.0 * (aim - x1) - 5.0 * v1 - f1
    deep = x2 - p.wall
    if deep > 0.0:
        rest = f2 / p.stiffness
        off = deep - rest
        x = x2 + (p.turn * off + p.lever * v2)
        v = v2 + (p.turn * v2 - p.swing * off)
        meets = x <= p.wall
        if v2 < 0.0 and v > 0.0:
            meets = meets or deep * (deep - 2.0 * rest) + p.slack * v2 * v2 >= 0.0
    else:
        x = x2 + (p.period * v2 + p.give * f2)
        v = v2 + p.gain * f2
        meets = x >= p.wall
        if v2 > 0.0 and v < 0.0:
            meets = meets or deep + p.period * v2 >= 0.0
    if meets:
        x, v = meet_wall(p, x2, v2, f2)
    x1 = x1 + (p.period * v1 + p.give_1 * hand)
    v1 = v1 + p.gain_1 * hand
    return x1, v1, x, v, f1, out1, out2


def run_plain(
    sets: Sequence[Plain],
    aims: Sequence[float],
    line: MutableSequence[float],
    rows: MutableSequence[float],
    out: MutableSequence[float],
    sizes: Sequence[int],
) -> int:
    """Run sets one after the other; `sizes`: sets, steps, whether rows are kept.

    `line` holds `2 * DELAY` waves; `out` takes the sum of squares of the distance between both
    and the greatest force on the master, of each set; `rows`, of each set and step, the
    positions of both at its end and that force [m, m, N].
    """
    at = 0
    for i in range(sizes[0]):
        p = sets[i]
        for j in range(2 * DELAY):
            line[j] = 0.0
        x1 = 0.0
        v1 = 0.0
        x2 = 0.0
        v2 = 0.0
        total = 0.0
        peak = 0.0
        head = 0
        for k in range(sizes[1]):
            in1 = line[head]
            in2 = line[DELAY + head]
            x1, v1, x2, v2, f1, out1, out2 = plain_step(p, x1, v1, x2, v2, in1, in2, aims[k])
            line[head] = out2
            line[DELAY + head] = out1
            head = head + 1
            if head == DELAY:
                head = 0
            off = x1 - x2
            total = total + off * off
            size = math.fabs(f1)
            if size > peak:
                peak = size
            if sizes[2] > 0:
                rows[at] = x1
                rows[at + 1] = x2
                rows[at + 2] = f1
                at = at + 3
        out[2 * i] = total
        out[2 * i + 1] = peak
    return sizes[0]
