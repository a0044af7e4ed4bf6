"""What an axis may be driven to unseen: its part of a claim, and the bound on its effort."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import DEVIATIONS, Claim
from tautwave.config import Rig
from tautwave.laws.ramp import StallParams, stall_bound, stall_params
from tautwave.models.noise_colour import greatest_spectrum
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.parts import coupling_part
from tautwave.types import CommandDelay


def kinetic_energy(rig: Rig, axis_name: str) -> float:
    """Return what the device of an axis has at its velocity limit [J]; inf without a limit."""
    axis = rig.axes[axis_name]
    if axis.inertia is None or axis.velocity_limit is None:
        return math.inf
    return 0.5 * axis.inertia.value * axis.velocity_limit**2


def stall_energy(rig: Rig, axis_name: str) -> float:
    """Return what a device let go may gain in a stall, where that bounds the effort [J]."""
    given = rig.axes[axis_name].stall_energy_j
    return given if isinstance(given, float) else kinetic_energy(rig, axis_name)


def stall_of(rig: Rig, axis_name: str, delay: CommandDelay) -> StallParams | None:
    """Return the bound on the effort of an axis for a host that stalls; None: it has none.

    Without `stall_energy_j` the device may gain what it has at its velocity limit, if that leaves
    the whole effort at rest. A law without an account relies on the efforts that it asks for.
    """
    bound = _bound_of(rig, axis_name, delay) if coupling_part(rig).claim else None
    if bound is None or rig.axes[axis_name].stall_energy_j is not None:
        return bound
    return bound if _leaves_all(rig, axis_name, delay, bound) else None


def _bound_of(rig: Rig, axis_name: str, delay: CommandDelay) -> StallParams | None:
    energy, has = stall_energy(rig, axis_name), axis_allowance(rig, axis_name, delay)
    if math.isinf(has.inertia) or math.isinf(energy):
        return None
    doubt = velocity_doubt(rig, axis_name)
    return stall_params(has.blind, has.inertia, has.shared_rate, energy, doubt, has.load_effort)


def _leaves_all(rig: Rig, axis_name: str, delay: CommandDelay, bound: StallParams) -> bool:
    """Return whether a bound leaves the whole effort at rest."""
    return stall_bound(bound, 0.0) >= axis_allowance(rig, axis_name, delay).shared_effort


def longest_overrun(rig: Rig, delays: Mapping[str, CommandDelay]) -> int | None:
    """Return the greatest `overrun_limit` at which the bound for stalls leaves all efforts at rest.

    At most what a rig without one has; None where an axis that takes effort states no inertia or
    velocity limit, and where no limit would do.
    """
    loop = rig.loop.model_copy(update={"overrun_limit": None})
    most = rig.model_copy(update={"loop": loop}).overrun_limit
    for limit in range(most, 1, -1):
        loop = rig.loop.model_copy(update={"overrun_limit": limit})
        trial = rig.model_copy(update={"loop": loop})
        for name, axis in rig.axes.items():
            if axis.causality != "impedance":
                continue
            bound = _bound_of(trial, name, delays[name])
            if bound is None:
                return None
            if not _leaves_all(trial, name, delays[name], bound):
                break
        else:
            return limit
    return None


def sure_effort(stall: StallParams, has: AxisAllowance, delay: CommandDelay) -> float:
    """Return the effort up to which a bound for stalls binds at no velocity [N m or N].

    An axis runs at up to its velocity limit, and is predicted to be faster by what acted since the
    last sample but one and is under way.
    """
    commands = has.blind / has.period + 2.0 * delay.periods
    ahead = 0.5 * has.period / has.inertia * commands * has.effort
    return stall_bound(stall, has.velocity + ahead)


def velocity_doubt(rig: Rig, axis_name: str) -> float:
    """Return how far the tracked velocity of an axis may be off by its encoder [rad/s or m/s]."""
    axis, period = rig.axes[axis_name], rig.axis_period_s(axis_name)
    error = 0.5 * axis.encoder_quantum + DEVIATIONS * axis.position_noise
    return 2.0 * error / (period + axis.velocity_filter_s)


def axis_claim(rig: Rig, axis_name: str, delay: CommandDelay) -> Claim:
    """Return what an axis may supply, by the axis alone: no reserve, no leak, and no spring.

    All that is sent to a motor is limited to its effort, whatever requested it, and to what the
    bound for stalls leaves of it.
    """
    axis, has = rig.axes[axis_name], axis_allowance(rig, axis_name, delay)
    takes_effort = not math.isinf(has.inertia)
    stall, effort, bounded = stall_of(rig, axis_name, delay), has.effort, math.inf
    if stall is not None:
        effort = min(effort, stall_bound(stall, 0.0) + stall.kept)
        bounded = stall_energy(rig, axis_name)
    return Claim(
        reserve=0.0,
        leak=0.0,
        feigned=0.0,
        effort=effort,
        rate=has.shared_rate if takes_effort else math.inf,
        velocity=has.velocity,
        period=has.period,
        blind=has.blind / has.period,
        mass=has.inertia,
        deviation=axis.position_noise,
        peak=greatest_spectrum(axis.position_noise_autocorrelation),
        quantum=axis.encoder_quantum,
        nonlinearity=axis.encoder_nonlinearity,
        stop_damping=has.brake_damping if takes_effort else 0.0,
        release=rig.coupling.release_ramp_s if takes_effort else 0.0,
        kinetic=kinetic_energy(rig, axis_name) if takes_effort else 0.0,
        late=has.delay / has.period,
        travel=math.inf if has.mechanical_range is None else has.mechanical_range,
        bounded=bounded,
    )
