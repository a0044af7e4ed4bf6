"""What holds an axis in its place while no coupling does; SI units."""

from __future__ import annotations

import math

from tautwave.analysis.walls.limits import greatest_damping
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.config import Rig
from tautwave.config.keys.operate import Resting
from tautwave.laws.rest.brake import SHARE, BrakeParams, passive_stiffness, step_power
from tautwave.rig.arms import load_reserves, load_stiffnesses
from tautwave.types import CommandDelay

SLOW = 0.7
"""Time constant of the damper's velocity filter times the frequency of device on spring.

A slower filter bears a larger damper, in proportion; beyond this, its lag takes that away again.
"""

RISE = 0.5
"""Share of an effort rate limit that the spring may ask for at the velocity limit."""

STEPS = 10.0
"""Encoder steps that a brake may give out against the device's damping."""


def resting_keys(rig: Rig) -> Resting | None:
    """Return how axes of a rig rest, None where a coupling holds them all the time."""
    return rig.sites or rig.operate


def braked_axes(rig: Rig) -> list[str]:
    """Return the full names of the axes that have a brake; others take velocities, or rest free."""
    keys = resting_keys(rig)
    if keys is None or keys.hold_effort_share == 0.0:
        return []
    return [name for name, axis in rig.axes.items() if axis.causality == "impedance"]


def spare_damping(rig: Rig, axis_name: str, delay: CommandDelay) -> float:
    """Return the device's certain damping less what its load's compensation takes [N m s/rad]."""
    lower = rig.axes[axis_name].damping.lower
    if axis_name not in load_reserves(rig):
        return lower
    slope = load_stiffnesses(rig, axis_name.partition(".")[0])[axis_name]
    late = delay.periods + delay.remainder_s / rig.period_s
    return lower - slope * rig.period_s * (1.0 + 2.0 * late)


def brake_params(rig: Rig, axis_name: str, delay: CommandDelay) -> BrakeParams | None:
    """Return the constants of an axis' brake, None without one or without damping to spare.

    The damper is the greatest passive one behind its velocity filter: a damping ratio of about a
    quarter.
    """
    keys, axis = resting_keys(rig), rig.axes[axis_name]
    device = spare_damping(rig, axis_name, delay)
    if keys is None or axis_name not in braked_axes(rig) or device <= 0.0:
        return None
    assert axis.inertia is not None
    assert axis.velocity_limit is not None
    period = rig.axis_period_s(axis_name)
    late = delay.periods + delay.remainder_s / period
    effort = keys.hold_effort_share * axis.effort_limit
    stiffness = passive_stiffness(device, period, late)
    if axis.effort_rate_limit is not None:
        stiffness = min(stiffness, RISE * axis.effort_rate_limit / axis.velocity_limit)
    mass = axis.inertia.lower
    filter_s = SLOW * math.sqrt(mass / stiffness)
    damper = SampledWall(0.0, 0.0, period, late, filter_s)
    damping = greatest_damping(damper, SHARE * device)
    quantum = max(axis.encoder_quantum, 4.0 * axis.position_noise)
    held = period * (2.0 + late) + rig.overrun_limit * rig.period_s
    return BrakeParams(
        stiffness=stiffness,
        damping=damping,
        gain=period / (period + filter_s),
        slip=effort / stiffness,
        period=period,
        device=device,
        quantum=quantum,
        # A sample that is lost at full stretch lets go of what the spring holds, at most.
        capital=STEPS * device * quantum**2 / period + 0.5 * effort**2 / stiffness,
        power=step_power(device, period, quantum, axis.effort_quantum),
        reserve=effort * held * (axis.velocity_limit + 0.5 * effort * held / mass),
    )
