"""What holds an axis in its place while no coupling does; SI units."""

from __future__ import annotations

import math

from tautwave.config import Rig
from tautwave.config.keys.operate import Resting
from tautwave.laws.rest.alignment import held_work
from tautwave.laws.rest.brake import SHARE, BrakeParams, passive_stiffness, step_power
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.types import CommandDelay

SLOW = 0.7
"""Time constant of the damper's velocity filter times the frequency of device on spring.

A slower filter bears a larger damper, in proportion; beyond this, its lag takes that away again.
"""

RISE = 0.25
"""Share of an effort rate limit that spring or damper may need at the velocity limit.

The spring's effort rises by K v. The damper's changes by 2 B g v / T where the velocity jumps from
limit to limit, g the gain of its filter, and takes two of these shares.
"""

STEPS = 10.0
"""Encoder steps that a brake may give out against the device's damping."""


def resting_keys(rig: Rig) -> Resting | None:
    """Return how axes of a rig rest, None where a coupling holds them all the time."""
    return rig.sites or rig.operate


def braked_axes(rig: Rig) -> list[str]:
    """Return the full names of the axes that have a brake; the others take velocities."""
    keys = resting_keys(rig)
    if keys is None or keys.hold_effort_share == 0.0:
        return []
    return [name for name, axis in rig.axes.items() if axis.causality == "impedance"]


def quantum_of(rig: Rig, axis_name: str) -> float:
    """Return the motion of an axis at rest that its encoder may show [rad or m]."""
    axis = rig.axes[axis_name]
    return max(axis.encoder_quantum, 4.0 * axis.position_noise)


def brake_params(rig: Rig, axis_name: str, delay: CommandDelay) -> BrakeParams | None:
    """Return the constants of an axis' brake, None without one or without damping to spare.

    The damper is the greatest passive one behind its velocity filter: a damping ratio of about a
    quarter.
    """
    keys = resting_keys(rig)
    if keys is None or axis_name not in braked_axes(rig):
        return None
    has = axis_allowance(rig, axis_name, delay)
    device = has.brake_damping
    if device <= 0.0:
        return None
    # Offline mathematics, loaded by a live run only for a brake, and before anything is enabled.
    from tautwave.analysis.walls.limits import greatest_damping
    from tautwave.analysis.walls.sampled import SampledWall

    assert math.isfinite(has.velocity)
    period = has.period
    late = delay.periods + delay.remainder_s / period
    effort = keys.hold_effort_share * has.shared_effort
    rise = RISE * has.shared_rate / has.velocity
    stiffness = min(passive_stiffness(device, period, late), rise)
    mass = has.inertia
    filter_s = SLOW * math.sqrt(mass / stiffness)
    gain = period / (period + filter_s)
    damper = SampledWall(0.0, 0.0, period, late, filter_s)
    damping = min(greatest_damping(damper, SHARE * device), rise * period / gain)
    quantum = quantum_of(rig, axis_name)
    held = period * (2.0 + late) + rig.overrun_limit * rig.period_s
    return BrakeParams(
        stiffness=stiffness,
        damping=damping,
        gain=gain,
        slip=effort / stiffness,
        period=period,
        device=device,
        quantum=quantum,
        # What the spring holds from before, and what lost samples make it let go of.
        capital=STEPS * device * quantum**2 / period + effort**2 / stiffness,
        power=step_power(device, period, quantum, has.quantum),
        reserve=held_work(effort, held, has.velocity, mass),
    )
