"""From a rig's keys to the constants of its laws: sites and pairs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from tautwave import registry
from tautwave.allowance import AxisAllowance
from tautwave.analysis.identification.sensor_balance import DEVIATIONS, most_at_rest
from tautwave.columns import Column
from tautwave.config import Axis, Rig, local_wall
from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.records import NEVER, PIPE, AxisParams, PairParams, RunParams
from tautwave.controller.steps import Law, NoParams
from tautwave.controller.stops import ARM_SHARE, ARM_TIMEOUT_S, AxisName, position_unit
from tautwave.errors import ConfigError
from tautwave.laws.limit import LimitParams
from tautwave.laws.ramp import NO_STALL
from tautwave.laws.servo.follower import FollowerParams
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import NO_WALL, WallParams
from tautwave.rig.allowance.filling import axis_allowance, wall_push
from tautwave.rig.claims import stall_of, sure_effort
from tautwave.rig.clips import clips
from tautwave.rig.network import trace_of
from tautwave.rig.parts import coupling_part
from tautwave.rig.scales import pair_scale, slave_offset
from tautwave.rig.support import compensation_params, inertia_params
from tautwave.streams import SEED_WORD
from tautwave.types import CommandDelay

if TYPE_CHECKING:
    from tautwave.runtime.control import CoupledControl


def coupling_law(rig: Rig) -> Law:
    """Return the steps of a rig's law, its state and its columns.

    Raises
    ------
    ConfigError
        Its columns are declared as they were before 0.3.
    """
    part = coupling_part(rig)
    law: Law = registry.load_named(part.law)
    if not all(isinstance(column, Column) for column in law.signals):
        raise ConfigError(
            f"law {law.name}: its `signals` have to be tautwave.plugin.Column, each with name, "
            "unit, meaning and value; before 0.3 they were names: update the package or the file "
            "that it comes from"
        )
    return law if rig.link is None else law_over_link(part)


def law_over_link(part: CouplingPlugin) -> Law:
    """Return a coupling's law over a network: its own, or made from that without one."""
    over_link = registry.load_named(part.over_link)
    law: Law = over_link if isinstance(over_link, Law) else over_link(registry.load_named(part.law))
    return law


def coupled_axis(rig: Rig, axis_name: str, delay: CommandDelay) -> CoupledAxis:
    """Return what a coupling gets to know of an axis."""
    axis = rig.axes[axis_name]
    allowance = axis_allowance(rig, axis_name, delay)
    place, noise, effort = axis.encoder_quantum, axis.position_noise, axis.effort_quantum
    if axis.follower is not None:
        # The goal is a number; what is read of the device stretches the spring.
        effort = axis.follower.stiffness * (place + 2.0 * noise)
        place = noise = 0.0
    return CoupledAxis(
        period=rig.axis_period_s(axis_name),
        gain=velocity_gain(rig, axis),
        inertia=None if axis.inertia is None else allowance.inertia,
        encoder_quantum=place,
        position_noise=noise,
        delay=delay.periods,
        outside_stiffness=axis.outside_stiffness,
        late=delay.remainder_s / rig.axis_period_s(axis_name),
        velocity_limit=allowance.velocity,
        effort_quantum=effort,
        noise_lags=axis.position_noise_autocorrelation,
        effort_limit=allowance.shared_effort,
        mass=None if axis.inertia is None else axis.inertia.value,
        viscous=axis.damping.value,
        coulomb=axis.coulomb.value,
        senses=axis.effort_sensor is not None,
        follows=None if axis.follower is None else axis.follower.lag_s,
        effort_rate=allowance.shared_rate,
    )


def end_constants(rig: Rig, axis_name: str, delay: CommandDelay) -> Any:
    """Return what the coupling makes of its keys for one axis, in the device's own units."""
    return end_of(rig, axis_name, coupled_axis(rig, axis_name, delay))


def end_of(rig: Rig, axis_name: str, known: CoupledAxis) -> Any:
    """Return what the coupling makes of its keys for an axis of which it gets to know this."""
    side, name = axis_name.split(".")
    make = registry.load_named(coupling_part(rig).end_constants)
    return make(rig.coupling.pairs[name], side, known)


def check_ends(rig: Rig, delays: Mapping[str, CommandDelay]) -> None:
    """Refuse a rig whose coupling cannot run on some of its axes.

    Raises
    ------
    ConfigError
        With a sentence for every such axis.
    """
    sentences = []
    for name in delays:
        try:
            end_constants(rig, name, delays[name])
        except ConfigError as err:
            sentences.append(str(err))
    if sentences:
        raise ConfigError("\n".join(dict.fromkeys(sentences)))


def between(rig: Rig, name: str, at: int) -> tuple[Any, list[float]]:
    """Return constants of what lies between the ends of a pair, and its floats from `at` on."""
    part = coupling_part(rig)
    if rig.link is None:
        named = part.link_constants
        link = registry.load_named(named)(rig.coupling, rig.period_s) if named else NoParams()
        return link, [0.0] * (coupling_law(rig).rings * rig.delay_samples)
    pair, trace = rig.coupling.pairs[name], trace_of(rig.link)
    constants = registry.load_named(part.linked)(
        rig.link, pair, rig.period_s, lower_velocity(rig, name), rig.seed % SEED_WORD, at, trace
    )
    params, floats = constants
    return params, floats


def lower_velocity(rig: Rig, name: str) -> float:
    """Return the lower velocity limit of a pair's devices [rad/s or m/s, master]."""
    scale = rig.coupling.pairs[name].position_scale
    limits = (rig.master.axes[name].velocity_limit, rig.slave.axes[name].velocity_limit)
    known = [
        limit / by for limit, by in zip(limits, (1.0, scale), strict=True) if limit is not None
    ]
    return min(known, default=math.inf)


def velocity_gain(rig: Rig, axis: Axis) -> float:
    """Return the gain of the velocity tracker: 1 without a filter."""
    period = rig.period_s * rig.buses[axis.bus].divisor
    return period / (period + axis.velocity_filter_s)


def wall_params(rig: Rig, axis_name: str, delay: CommandDelay) -> WallParams:
    """Return the constants of an axis' wall.

    It may be in debt by what its greatest effort can give while a stalled host holds it, the device
    going at its velocity limit and driven by that effort. Nothing bounds that on an axis without a
    velocity limit, nor then the debt.
    """
    keys = local_wall(rig, axis_name)
    if keys is None:
        return NO_WALL
    side = 1.0 if keys.side == "above" else -1.0
    wall = WallParams(
        keys.position, side, keys.stiffness, keys.damping, controlled=keys.passivity_control
    )
    allowance = axis_allowance(rig, axis_name, delay)
    if math.isinf(allowance.velocity) or math.isinf(allowance.inertia):
        return wall
    push = min(wall_push(rig.axes[axis_name], keys), allowance.shared_effort)
    held = allowance.blind - allowance.delay + allowance.period
    reach = allowance.velocity * held
    drift = 0.5 * held * held / allowance.inertia
    reserve = push * (reach + drift * push)
    return wall._replace(reserve=reserve, reach=reach, drift=drift, most=push)


def limit_params(axis: Axis, allowance: AxisAllowance) -> LimitParams:
    """Return the limits of an axis without what is kept for its load; an absent one is infinite."""
    low, high = (-math.inf, math.inf) if axis.position_range is None else axis.position_range
    return LimitParams(
        effort=allowance.shared_effort,
        effort_step=allowance.shared_step,
        effort_quantum=allowance.quantum if axis.causality == "impedance" else 0.0,
        velocity=allowance.velocity,
        position_low=low,
        position_high=high,
        # A damper B needs device damping b >= B (Colgate): use the lower bound. Nothing else acts
        # but what carries a load, and spends its part of it.
        stop_damping=allowance.brake_damping,
    )


def site_params(rig: Rig, axis_name: str, delay: CommandDelay) -> SiteParams:
    """Return the constants of one axis but for its coupling, in the device's own units."""
    side, name = axis_name.split(".")
    axis = rig.axes[axis_name]
    keys = rig.coupling.pairs[name]
    wall = keys.wall_master if side == "master" else keys.wall_slave
    clip, wall_clip = clips(rig, axis_name, alike=coupling_law(rig).alike)
    return bare_site(rig, axis_name, delay)._replace(
        clip=clip,
        wall_clip=wall_clip,
        wall=wall_params(rig, axis_name, delay),
        velocity_quantum=axis.velocity_quantum if axis.causality == "admittance" else 0.0,
        has_wall=wall is not None,
        compensation=compensation_params(axis, axis_allowance(rig, axis_name, delay)),
        compensates=axis.compensation is not None and axis.compensation.friction,
    )


def follower_params(rig: Rig, axis_name: str, delay: CommandDelay) -> FollowerParams | None:
    """Return goal and spring of an axis whose device takes positions, None of others."""
    axis = rig.axes[axis_name]
    if axis.follower is None:
        return None
    low, high = (-math.inf, math.inf) if axis.position_range is None else axis.position_range
    stiffness = axis.follower.stiffness
    has = axis_allowance(rig, axis_name, delay)
    lead = has.shared_effort / stiffness
    return FollowerParams(has.period, stiffness, lead, low, high)


STILL_DEVIATIONS, STILL_STEPS = 6.0, 2.0
"""How far apart two readings of a device at rest may be, in deviations and steps of its encoder."""


def bare_site(rig: Rig, axis_name: str, delay: CommandDelay) -> SiteParams:
    """Return the constants of an axis without a wall that takes efforts."""
    axis = rig.axes[axis_name]
    allowance = axis_allowance(rig, axis_name, delay)
    period = allowance.period
    return SiteParams(
        period=period,
        half_mobility=period / (2.0 * allowance.inertia),  # 0 where it takes velocities
        wall=NO_WALL,
        limit=limit_params(axis, allowance),
        gain=velocity_gain(rig, axis),
        velocity_quantum=0.0,
        has_wall=False,
        still=STILL_DEVIATIONS * axis.position_noise + STILL_STEPS * axis.encoder_quantum,
    )


def rest_effort(rig: Rig, axis_name: str, delay: CommandDelay, end: Any) -> float:
    """Return the most that an axis' effort sensor may show before the pairs engage [N m or N].

    Of a coupling that is fed by it (`measures` of its end). Unknown where a load or an arm is
    carried. Sites engage again in mid-run, with hands on them: there the report says it.
    """
    side = axis_name.partition(".")[0]
    axis = rig.axes[axis_name]
    sensor = axis.effort_sensor
    carries = axis.load is not None or bool(rig.arms(side))
    if sensor is None or carries or rig.sites is not None or not getattr(end, "measures", False):
        return math.inf
    doubt = (DEVIATIONS * sensor.noise + 0.5 * sensor.quantum) / sensor.scale
    most = axis_allowance(rig, axis_name, delay).effort
    return most_at_rest(axis.coulomb.value, most) + doubt


def axis_params(rig: Rig, axis_name: str, delay: CommandDelay, pipe: int) -> AxisParams:
    """Return all constants of one axis; its commands wait in the table from `pipe` on."""
    side, name = axis_name.split(".")
    scale = pair_scale(rig.coupling.pairs[name])
    keys = rig.axes[axis_name].compensation
    known = coupled_axis(rig, axis_name, delay)
    end = end_of(rig, axis_name, known)
    allowance = axis_allowance(rig, axis_name, delay)
    stall = stall_of(rig, axis_name, delay)
    return controlled_axis(
        rig,
        axis_name,
        delay,
        site_params(rig, axis_name, delay)._replace(
            inertia=inertia_params(
                rig.axes[axis_name],
                known,
                allowance.lift_effort,
                allowance.paying_coulomb,
            ),
            compensates_inertia=keys is not None and keys.inertia > 0.0,
            stall=NO_STALL if stall is None else stall,
            sure=math.inf if stall is None else sure_effort(stall, allowance, delay),
        ),
        pipe,
        weight=1.0 if side == "master" else 1.0 / scale.power,
        end=end,
        blind=rig.loop.missing_limit if side in rig.own_sides else NEVER,
    )._replace(
        rest_effort=rest_effort(rig, axis_name, delay, end),
        fed=bool(getattr(end, "measures", False)),
    )


def controlled_axis(
    rig: Rig,
    axis_name: str,
    delay: CommandDelay,
    site: SiteParams,
    pipe: int,
    *,
    weight: float = 1.0,
    end: Any = None,
    blind: int = NEVER,
) -> AxisParams:
    """Return the constants of one axis around those of its laws; by default an uncoupled axis."""
    impedance = rig.axes[axis_name].causality == "impedance"
    sensor = rig.axes[axis_name].effort_sensor
    return AxisParams(
        site=site,
        half_period=0.5 * site.period,
        late=delay.remainder_s / rig.axis_period_s(axis_name),
        ceiling=site.limit.effort if impedance else site.limit.velocity,
        weight=weight,
        delay=delay.periods,
        pipe=pipe,
        impedance=impedance,
        divisor=rig.axis_divisor(axis_name),
        half_slot=0.5 * rig.period_s,
        end=end,
        blind=blind,
        senses=sensor is not None,
        sensor_zero=0.0 if sensor is None else sensor.offset,
        sensor_gain=1.0 if sensor is None else 1.0 / sensor.scale,
    )


def is_rated(rig: Rig, name: str) -> bool:
    """Return whether a side of a pair is slow."""
    return max(rig.axis_divisor(f"{side}.{name}") for side in ("master", "slave")) > 1


def pair_params(
    rig: Rig, name: str, axes: Sequence[str], line: int, link: Any = None
) -> PairParams:
    """Return the constants of one pair; `axes` are all axes in their order, see `PairParams`.

    `link` are those `between` its ends, if they are known already.
    """
    keys = rig.coupling.pairs[name]
    scale = pair_scale(keys)
    offset, tolerance = slave_offset(keys)
    return PairParams(
        master=axes.index(f"master.{name}"),
        slave=axes.index(f"slave.{name}"),
        rated=is_rated(rig, name),
        at_engage=offset is None,
        ratio=scale.sign * scale.scale,
        sign=scale.sign,
        force_scale=scale.force_scale,
        to_master=scale.sign / scale.scale,
        weight=1.0 / scale.power,
        period=rig.period_s,
        half_period=0.5 * rig.period_s,
        offset=0.0 if offset is None else offset,
        tolerance=tolerance,
        samples=rig.delay_samples,
        line=line,
        link=between(rig, name, line)[0] if link is None else link,
    )


def run_params(rig: Rig, cycles: int, axes: int) -> RunParams:
    """Return length, limits and the coupling's ramps of a run."""
    rate = rig.rate_hz
    ramps = rig.coupling
    return RunParams(
        period_ns=rig.period_ns,
        cycles=cycles,
        axes=axes,
        pairs=len(rig.coupling.pairs),
        engage_cycles=round(ramps.engage_ramp_s * rate),
        release_cycles=round(ramps.release_ramp_s * rate),
        missing_limit=rig.loop.missing_limit,
        overrun_limit=rig.overrun_limit,
        arm_share=ARM_SHARE,
        # Two sites wait for each other in their own time.
        arm_timeout_ns=ARM_TIMEOUT_S * 1e9 if rig.site is None else math.inf,
    )


def axis_names(rig: Rig, axes: Sequence[str]) -> list[AxisName]:
    """Return the display names of the axes."""
    return [AxisName(name, rig.axes[name].bus, position_unit(rig.axes[name].kind)) for name in axes]


def make_control(rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> CoupledControl:
    """Return the controller of a run; `delays` by axis, in the order of buses and their axes.

    The axes of another site come last, as stand-ins.
    """
    # A certificate reads this module's constants, and runs nothing.
    from tautwave.runtime.control import CoupledControl

    delays = {**delays, **{name: CommandDelay(0, 0.0) for name in rig.axes if name not in delays}}
    axes = tuple(delays)
    law = coupling_law(rig)
    at = 0
    params = []
    for name in axes:
        try:
            params.append(axis_params(rig, name, delays[name], at))
        except ConfigError:
            check_ends(rig, delays)
            raise
        at += PIPE * delays[name].periods
    pairs = []
    table = [0.0] * at
    for name in rig.coupling.pairs:
        at = len(table)
        link, floats = between(rig, name, at)
        pairs.append(pair_params(rig, name, axes, at, link))
        table += floats
    run = run_params(rig, cycles, len(axes))
    names = axis_names(rig, axes)
    wire = None
    if rig.link is not None and rig.site is None:
        from tautwave.runtime.wire import Wire

        wire = Wire(pairs)
    return CoupledControl(run, names, params, tuple(rig.coupling.pairs), pairs, table, law, wire)
