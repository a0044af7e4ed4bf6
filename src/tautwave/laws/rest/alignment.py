"""Alignment: bring a device to where its coupling may engage, with a budget of energy.

An active motion: a reference runs to the target with limited speed and acceleration, and a spring
and damper pull the device along. The reference never runs further ahead than the greatest effort
stretches the spring, so a blocked device is pushed with that effort and no more, and nothing winds
up. What the motor has put into the device is counted, as the encoder sees it; at the end of the
budget it may only brake, and then do nothing. SI units; rotary axes read N m for N and rad for m.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave.laws.limit import clamp


class AlignParams(NamedTuple):
    """Constants of an alignment.

    stiffness [N/m] and damping [N s/m] of the pull; effort [N], speed [m/s] and acceleration
    [m/s2] never exceeded; period [s]; reserve [J] is what a command may put in until a sample has
    shown it and another one acts; brake [N s/m] and friction [N], a lower bound, of the limit of
    speed.
    """

    stiffness: float
    damping: float
    effort: float
    speed: float
    acceleration: float
    period: float
    reserve: float
    brake: float
    friction: float


STIFF = 0.1
"""Natural frequency of the pull, in units of one over the time until a command acts."""

DAMPED = 0.7
"""Its damping ratio."""

PATIENT = 0.35
"""Of the pull's natural frequency, how fast a push grows: a fifth of what would make it swing."""

EARLY = 10.0
"""How much sooner than the spring friction is pushed against."""


def align_law(
    mass: float,
    friction: float,
    effort: float,
    speed: float,
    acceleration: float,
    period: float,
    delay: float,
    lag: float,
    *,
    rate: float = math.inf,
    fastest: float = 0.0,
    stalled: float = 0.0,
) -> AlignParams:
    """Return the constants for a device of at least `mass` [kg] and `friction` [N].

    A command acts `delay` [s] after its sample and for a period; `lag` [s] is from a motion until
    the effort that answers it acts, the filter of the velocity included. A brake of a third of mass
    over lag approaches the speed without passing it, and no effort is above what it allows a device
    at rest. Efforts change by `rate` [N/s] at most: neither brake nor spring may ask for more. A
    command acts for its delay, a period more, and `stalled` [s] if the host stands still, on a
    device that moves with up to `fastest` [m/s] and is driven beyond (`analysis.claim`).
    """
    within = math.sqrt(rate / (3.0 * mass * speed))
    frequency = min(STIFF / (period + delay), within)
    brake = min(mass / (3.0 * lag), mass * within)
    effort = min(effort, friction + brake * speed)
    held = 2.0 * period + delay + stalled + 0.5 * effort / rate
    reserve = held_work(effort, held, max(speed, fastest), mass)
    return AlignParams(
        stiffness=mass * frequency * frequency,
        damping=2.0 * DAMPED * mass * frequency,
        effort=effort,
        speed=speed,
        acceleration=acceleration,
        period=period,
        reserve=reserve,
        brake=brake,
        friction=friction,
    )


def held_work(effort: float, held: float, speed: float, mass: float) -> float:
    """Return what an effort [N] that stays for `held` s may give [J] to a device of `mass` [kg].

    It moves with `speed` [m/s], and is driven beyond.
    """
    return effort * held * (speed + 0.5 * effort * held / mass)


def align_budget(
    p: AlignParams, gap: float, coulomb: float, viscous: float, inertia: float
) -> float:
    """Return the energy [J] that a motion over `gap` [m] may take.

    Twice what friction (coulomb [N], viscous [N s/m]) and the kinetic energy at full speed need,
    a reserve for the last push, and one for the last that brakes.
    """
    friction = (coulomb + viscous * p.speed) * math.fabs(gap)
    return 2.0 * (friction + 0.5 * inertia * p.speed * p.speed + p.reserve)


def move_reference(
    p: AlignParams, reference: float, rate: float, target: float
) -> tuple[float, float]:
    """Return position [m] and rate [m/s] of the reference one period on.

    The rate is what can still be braked with the acceleration before the target, and changes by no
    more than the acceleration allows; the last step ends at the target.
    """
    gap = target - reference
    step = p.acceleration * p.period
    away = math.fabs(gap)
    if away <= step * p.period and math.fabs(rate) <= step:
        return target, 0.0
    # Speed from which `away` suffices to stop in steps of one period.
    wanted = math.sqrt(0.25 * step * step + 2.0 * p.acceleration * away) - 0.5 * step
    if wanted > p.speed:
        wanted = p.speed
    if gap < 0.0:
        wanted = -wanted
    rate = rate + clamp(wanted - rate, step)
    return reference + clamp(rate * p.period, away), rate


def lead_reference(
    p: AlignParams, reference: float, rate: float, position: float
) -> tuple[float, float]:
    """Keep the reference so near the device that the spring alone never asks for more effort."""
    ahead = p.effort / p.stiffness
    lead = reference - position
    if lead > ahead:
        return position + ahead, clamp(rate, 0.0)
    if lead < -ahead:
        return position - ahead, clamp(rate, 0.0)
    return reference, rate


def grow_push(p: AlignParams, push: float, reference: float, position: float) -> float:
    """Return what is pushed beside the spring [N], one period on.

    It grows while unknown friction holds the device short of the reference, and is gone
    once the device has passed it. Effort and speed stay limited whatever it is.
    """
    gap = reference - position
    if push * gap < 0.0:
        return 0.0
    rate = PATIENT * p.stiffness * p.stiffness / p.damping
    return clamp(push + rate * gap * p.period, p.effort)


def align_effort(
    p: AlignParams,
    reference: float,
    rate: float,
    position: float,
    velocity: float,
    push: float = 0.0,
) -> float:
    """Return the effort on the device [N], positive along its position."""
    pull = p.stiffness * (reference - position) + push
    # Friction would hold the device short of its target by c / k. What it surely has it dissipates
    # again, so a push of that size makes no motion faster.
    pull += clamp(EARLY * pull, p.friction) + p.damping * (rate - velocity)
    return limit_speed(p, pull, velocity)


def limit_speed(p: AlignParams, effort: float, velocity: float) -> float:
    """Return as much of an effort [N] as takes a device towards its greatest speed, not beyond.

    It falls with the velocity [m/s] to what friction surely takes, and brakes a device that is
    faster: one that an obstacle has let go of, too.
    """
    most = p.friction + p.brake * (p.speed - velocity)
    least = -p.friction - p.brake * (p.speed + velocity)
    if effort > most:
        effort = most
    if effort < least:
        effort = least
    return clamp(effort, p.effort)


def gate_effort(
    p: AlignParams, effort: float, velocity: float, spent: float, budget: float
) -> float:
    """Return the effort [N] that may be sent when `spent` of the `budget` [J] has gone in.

    At its end only braking is left, against the velocity [m/s]. It counts too: of a device that
    swings as fast as it is late it is a push.
    """
    if not is_spent(p, spent, budget):
        return effort
    return effort if effort * velocity < 0.0 and spent + p.reserve <= budget else 0.0


def is_spent(p: AlignParams, spent: float, budget: float) -> bool:
    """Return whether so much of the budget [J] has gone in that nothing may push any more."""
    return not spent + 2.0 * p.reserve <= budget
