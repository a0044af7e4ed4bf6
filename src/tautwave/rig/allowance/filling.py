"""From a rig's keys to the allowance of each axis: what it has, and what its features ask."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.allowance import LOAD_SHARE, AxisAllowance, Device, Spending, share_out
from tautwave.config import Axis, Rig, Wall, axis_damper, local_wall
from tautwave.errors import ConfigError
from tautwave.rig.allowance.once import once_per_rig
from tautwave.rig.arms import carries_loads, load_reserves, load_stiffnesses
from tautwave.rig.parts import coupling_part
from tautwave.types import CommandDelay, Damper


def allowances(rig: Rig, delays: Mapping[str, CommandDelay]) -> dict[str, AxisAllowance]:
    """Return the allowance of each axis of a rig that has a command delay, by full name.

    Raises
    ------
    ConfigError
        An axis has too little for what a feature of the rig asks of it.
    """
    return {name: axis_allowance(rig, name, delays[name]) for name in rig.axes if name in delays}


@once_per_rig
def axis_allowance(rig: Rig, axis_name: str, delay: CommandDelay) -> AxisAllowance:
    """Return what an axis has, who may spend it, and what its coupling gets; once per rig.

    Raises
    ------
    ConfigError
        A load leaves too little effort, or too little of the rate to move by one step.
    """
    allowance = share_out(_device(rig, axis_name, delay), _spending(rig, axis_name, delay))
    if allowance.starved and rig.axes[axis_name].causality == "impedance":
        unit = "N m" if rig.axes[axis_name].kind == "rotary" else "N"
        share = min(LOAD_SHARE, 1.0 - LOAD_SHARE)
        step = min(allowance.load_step, allowance.shared_step)
        enough = at_least(allowance.quantum / (share * allowance.period))
        if share * enough * allowance.period < allowance.quantum:
            # Rounded, its step is a hair too small.
            enough = at_least(1.0001 * enough)
        raise ConfigError(
            f"{axis_name.replace('.', '.axes.')}.effort_rate_limit: load and coupling get "
            f"{step:.4g} {unit} a period each, less than one effort_quantum "
            f"({allowance.quantum:g}), so both would stay 0; give {enough:g} or more "
            f"(got {allowance.effort_rate:g})"
        )
    return allowance


def at_least(value: float) -> float:
    """Return a positive number rounded up to four digits, as a remedy is printed."""
    step = 10.0 ** (math.floor(math.log10(value)) - 3)
    return float(f"{math.ceil(value / step * (1.0 - 1e-12)) * step:.4g}")


def _device(rig: Rig, axis_name: str, delay: CommandDelay) -> Device:
    axis = rig.axes[axis_name]
    period = rig.axis_period_s(axis_name)
    late = delay.periods + delay.remainder_s / period
    stops = axis.mechanical_range
    stalled = math.ceil(rig.overrun_limit / rig.axis_divisor(axis_name))
    return Device(
        period=period,
        delay=late * period,
        blind=(late + rig.loop.missing_limit + stalled) * period,
        effort=axis.effort_limit,
        effort_rate=math.inf if axis.effort_rate_limit is None else axis.effort_rate_limit,
        quantum=axis.effort_quantum,
        damping=axis.damping.lower,
        coulomb=axis.coulomb.lower,
        velocity=math.inf if axis.velocity_limit is None else axis.velocity_limit,
        inertia=math.inf if axis.inertia is None else axis.inertia.lower,
        mechanical_range=None if stops is None else stops[1] - stops[0],
    )


def _spending(rig: Rig, axis_name: str, delay: CommandDelay) -> Spending:
    axis = rig.axes[axis_name]
    asks = Spending()
    if axis.causality != "impedance":
        return asks
    reserve = load_reserves(rig).get(axis_name)
    if reserve is not None:
        asks = asks._replace(
            carries=True,
            load_effort=reserve,
            load_damping=load_damping(rig, axis_name, delay),
            load_coulomb=load_coulomb(rig, axis_name, delay),
        )
    if rig.scene is not None:
        return asks  # its controller compensates nothing, and its contacts are links
    keys = axis.compensation
    if keys is not None:
        asks = asks._replace(
            compensated_coulomb=keys.coulomb * axis.coulomb.lower,
            compensated_damping=keys.viscous * axis.damping.lower,
            paying_coulomb=keys.inertia_coulomb * axis.coulomb.lower,
            lift_effort=keys.inertia * (axis.effort_limit - asks.load_effort),
        )
    asks = asks._replace(relies=not coupling_part(rig).claim)
    damper = axis_damper(rig, axis_name)
    if damper is not None:
        asks = _with_damper(rig, axis_name, asks, damper)
    wall = local_wall(rig, axis_name)
    return asks if wall is None else _with_wall(rig, axis_name, delay, asks, wall)


def _with_damper(rig: Rig, axis_name: str, asks: Spending, damper: Damper) -> Spending:
    from tautwave.analysis.walls.in_motor import damper_needs, least_damping, least_device

    alone = rig.axes[axis_name].damping.lower - asks.compensated_damping
    needed = damper_needs(damper)
    period = rig.axis_period_s(axis_name)
    least = least_damping(damper, alone, period)
    lent = max(least - max(alone - needed, 0.0), 0.0)
    loads = 0.0
    if asks.carries and carries_loads(rig, axis_name, damper):
        spent = least_device(damper, alone, period, asks.load_damping) - needed
        loads = asks.load_damping - spent if spent < alone - needed else lent
    return asks._replace(damper_damping=needed, lent_damping=lent, load_lent=loads)


def _with_wall(
    rig: Rig, axis_name: str, delay: CommandDelay, asks: Spending, wall: Wall
) -> Spending:
    # Loaded only where there is a wall: a live run without one needs none of the analysis.
    from tautwave.analysis.walls.passivity import wall_leak
    from tautwave.analysis.walls.sampled import SampledWall

    axis = rig.axes[axis_name]
    period = rig.axis_period_s(axis_name)
    late = delay.periods + delay.remainder_s / period
    filter_s = axis.velocity_filter_s
    rendered = SampledWall(wall.stiffness, wall.damping, period, late, filter_s)
    needed = wall_leak(rendered).damping
    damper = axis_damper(rig, axis_name)
    if damper is not None:
        from tautwave.analysis.walls.in_motor import spent_on

        alone = axis.damping.lower - asks.compensated_damping
        needed = max(spent_on(damper, alone, rendered) - asks.damper_damping, 0.0)
    return asks._replace(
        wall_effort=wall_push(axis, wall),
        wall_rate=wall_steepness(rig, axis_name, wall),
        wall_limit=math.inf if wall.effort_limit is None else wall.effort_limit,
        wall_damping=needed,
        wall_controlled=wall.passivity_control,
    )


def wall_steepness(rig: Rig, axis_name: str, wall: Wall) -> float:
    """Return how fast a wall's effort may change at the velocity limit [N m/s or N/s].

    The spring's changes by K v a second, the damper's by 2 B g v in a period T, g = T / (T + t_f)
    the gain of its velocity filter.
    """
    axis = rig.axes[axis_name]
    if axis.velocity_limit is None:
        return math.inf
    behind = rig.axis_period_s(axis_name) + axis.velocity_filter_s
    return (wall.stiffness + 2.0 * wall.damping / behind) * axis.velocity_limit


def wall_push(axis: Axis, wall: Wall) -> float:
    """Return the greatest effort that a wall asks for within the axis' range [N m or N]."""
    given = math.inf if wall.effort_limit is None else wall.effort_limit
    if axis.position_range is None or axis.velocity_limit is None:
        return given
    low, high = axis.position_range
    depth = high - wall.position if wall.side == "above" else wall.position - low
    return min(given, wall.stiffness * max(depth, 0.0) + wall.damping * axis.velocity_limit)


def load_damping(rig: Rig, axis_name: str, delay: CommandDelay) -> float:
    """Return what carrying an axis' load takes of its damping [N m s/rad | N s/m].

    See `certificate.beside.loads` for why.
    """
    slope = load_stiffnesses(rig, axis_name.partition(".")[0])[axis_name]
    late = delay.periods + delay.remainder_s / rig.period_s
    return slope * rig.period_s * (1.0 + 2.0 * late)


def load_coulomb(rig: Rig, axis_name: str, delay: CommandDelay) -> float:
    """Return what carrying a load takes of the Coulomb friction, by encoder steps [N m | N]."""
    slope = load_stiffnesses(rig, axis_name.partition(".")[0])[axis_name]
    late = delay.periods + delay.remainder_s / rig.period_s
    return slope * rig.axes[axis_name].encoder_quantum * (1.0 + late)
