"""From a rig's keys to the constants of its laws: sites and pairs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from tautwave import registry
from tautwave.config import Axis, Rig, Wall
from tautwave.config import Pair as PairKeys
from tautwave.contracts import CoupledAxis, CouplingPlugin
from tautwave.controller.records import NEVER, PIPE, AxisParams, PairParams, RunParams
from tautwave.controller.steps import Law, NoParams
from tautwave.controller.stops import ARM_SHARE, ARM_TIMEOUT_S, AxisName, position_unit
from tautwave.laws.limit import LimitParams
from tautwave.laws.site import SiteParams
from tautwave.laws.tracked_port import PortParams, port_debt, port_params
from tautwave.laws.wall import WallParams
from tautwave.runtime.control import CoupledControl
from tautwave.types import CommandDelay

NO_WALL = WallParams(0.0, 1.0, 0.0, 0.0, controlled=False)


class PairScale(NamedTuple):
    """How slave units map to master units: x_slave = sign * scale * x_master + offset.

    `power` is the energy of the slave device per energy of the pair (force_scale * scale).
    """

    scale: float
    force_scale: float
    sign: float
    power: float


def pair_scale(keys: PairKeys) -> PairScale:
    """Return the mapping from slave units to the pair's."""
    force = keys.effective_force_scale
    return PairScale(keys.position_scale, force, float(keys.sign), force * keys.position_scale)


def coupling_part(rig: Rig) -> CouplingPlugin:
    """Return the declaration of a rig's coupling law."""
    return registry.load_coupling(rig.coupling.law)


def coupling_law(rig: Rig) -> Law:
    """Return the steps of a rig's law, its state and its columns."""
    found: Law = registry.load_named(coupling_part(rig).law)
    return found


def coupled_axis(rig: Rig, axis_name: str, delay: CommandDelay) -> CoupledAxis:
    """Return what a coupling gets to know of an axis."""
    axis = rig.axes[axis_name]
    return CoupledAxis(
        period=rig.axis_period_s(axis_name),
        gain=velocity_gain(rig, axis),
        inertia=None if axis.inertia is None else axis.inertia.lower,
        encoder_quantum=axis.encoder_quantum,
        position_noise=axis.position_noise,
        delay=delay.periods,
        outside_stiffness=axis.environment_stiffness_upper or 0.0,
        late=delay.remainder_s / rig.axis_period_s(axis_name),
        velocity_limit=math.inf if axis.velocity_limit is None else axis.velocity_limit,
        effort_quantum=axis.effort_quantum,
        noise_lags=axis.position_noise_autocorrelation,
    )


def end_constants(rig: Rig, axis_name: str, delay: CommandDelay) -> Any:
    """Return what the coupling makes of its keys for one axis, in the device's own units."""
    side, name = axis_name.split(".")
    make = registry.load_named(coupling_part(rig).end_constants)
    return make(rig.coupling.pairs[name], side, coupled_axis(rig, axis_name, delay))


def wave_port(rig: Rig, axis_name: str, delay: CommandDelay) -> PortParams:
    """Return the constants of an axis' port, for analysis; one of impedance 1 where it has none."""
    port = getattr(end_constants(rig, axis_name, delay), "port", None)
    if isinstance(port, PortParams):
        return port
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    return port_params(rig.axis_period_s(axis_name), 1.0, axis.inertia.lower, False, 1.0, 0.0)


def link_constants(rig: Rig) -> Any:
    """Return what the coupling makes of its keys for what lies between two ends."""
    named = coupling_part(rig).link_constants
    return registry.load_named(named)(rig.coupling, rig.period_s) if named else NoParams()


def velocity_gain(rig: Rig, axis: Axis) -> float:
    """Return the gain of the velocity tracker: 1 without a filter."""
    period = rig.period_s * rig.buses[axis.bus].divisor
    return period / (period + axis.velocity_filter_s)


def wall_params(keys: Wall | None) -> WallParams:
    """Return a wall's constants."""
    if keys is None:
        return NO_WALL
    side = 1.0 if keys.side == "above" else -1.0
    return WallParams(
        keys.position, side, keys.stiffness, keys.damping, controlled=keys.passivity_control
    )


def limit_params(rig: Rig, axis: Axis) -> LimitParams:
    """Return an axis' limits; an absent one is infinite."""
    low, high = (-math.inf, math.inf) if axis.position_range is None else axis.position_range
    step = math.inf
    if axis.effort_rate_limit is not None:
        step = axis.effort_rate_limit * rig.period_s * rig.buses[axis.bus].divisor
    return LimitParams(
        effort=axis.effort_limit,
        effort_step=step,
        effort_quantum=axis.effort_quantum if axis.causality == "impedance" else 0.0,
        velocity=math.inf if axis.velocity_limit is None else axis.velocity_limit,
        position_low=low,
        position_high=high,
        # A damper B needs device damping b >= B (Colgate): use the lower bound.
        stop_damping=axis.damping.lower,
    )


def site_params(rig: Rig, axis_name: str) -> SiteParams:
    """Return the constants of one axis but for its coupling, in the device's own units."""
    side, name = axis_name.split(".")
    axis = rig.axes[axis_name]
    keys = rig.coupling.pairs[name]
    wall = keys.wall_master if side == "master" else keys.wall_slave
    return bare_site(rig, axis_name)._replace(
        wall=wall_params(wall),
        velocity_quantum=axis.velocity_quantum if axis.causality == "admittance" else 0.0,
        has_wall=wall is not None,
    )


def bare_site(rig: Rig, axis_name: str) -> SiteParams:
    """Return the constants of an axis without a wall that takes efforts."""
    axis = rig.axes[axis_name]
    period = rig.axis_period_s(axis_name)
    return SiteParams(
        period=period,
        half_mobility=0.0 if axis.inertia is None else period / (2.0 * axis.inertia.lower),
        wall=NO_WALL,
        limit=limit_params(rig, axis),
        gain=velocity_gain(rig, axis),
        velocity_quantum=0.0,
        has_wall=False,
    )


class DebtRates(NamedTuple):
    """Greatest temporary debt of a port's account, `laws.tracked_port.port_debt`, for this rig.

    debt_per_speed_squared [kg or kg m^2]: to multiply by the square of the greatest speed;
    debt_per_flow [1]: to multiply by the gross energy flow.
    """

    debt_per_speed_squared: float
    debt_per_flow: float


def debt_rates(rig: Rig, axis_name: str, delays: Mapping[str, CommandDelay]) -> DebtRates:
    """Return the allowed debt of an impedance axis' port."""
    delay = delays[axis_name]
    port = end_constants(rig, axis_name, delay).port
    gain = velocity_gain(rig, rig.axes[axis_name])
    periods = delay.periods + (1 if delay.remainder_s > 0.0 else 0)
    return DebtRates(
        port_debt(port, periods, gain, 1.0, 0.0),
        port_debt(port, periods, gain, 0.0, 1.0),
    )


def wave_gain(scale: PairScale, side: str) -> float:
    """Return device wave per line wave."""
    return 1.0 if side == "master" else scale.sign * math.sqrt(scale.power)


def axis_params(rig: Rig, axis_name: str, delay: CommandDelay, pipe: int) -> AxisParams:
    """Return all constants of one axis; its commands wait in the table from `pipe` on."""
    side, name = axis_name.split(".")
    scale = pair_scale(rig.coupling.pairs[name])
    return controlled_axis(
        rig,
        axis_name,
        delay,
        site_params(rig, axis_name),
        pipe,
        weight=1.0 if side == "master" else 1.0 / scale.power,
        end=end_constants(rig, axis_name, delay),
        blind=rig.loop.missing_limit,
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
    )


def is_rated(rig: Rig, name: str) -> bool:
    """Return whether a side of a pair is slow."""
    return max(rig.axis_divisor(f"{side}.{name}") for side in ("master", "slave")) > 1


def pair_params(rig: Rig, name: str, axes: Sequence[str], line: int) -> PairParams:
    """Return the constants of one pair; `axes` are all axes in their order, see `PairParams`."""
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
        link=link_constants(rig),
    )


def run_params(rig: Rig, cycles: int, axes: int) -> RunParams:
    """Return length, ramps and limits of a run."""
    rate = rig.rate_hz
    ramps = rig.coupling if rig.scene is None else rig.scene
    return RunParams(
        period_ns=rig.period_ns,
        cycles=cycles,
        axes=axes,
        pairs=0 if rig.scene is not None else len(rig.coupling.pairs),
        engage_cycles=round(ramps.engage_ramp_s * rate),
        release_cycles=round(ramps.release_ramp_s * rate),
        missing_limit=rig.loop.missing_limit,
        overrun_limit=rig.loop.overrun_limit,
        arm_share=ARM_SHARE,
        arm_timeout_ns=ARM_TIMEOUT_S * 1e9,
    )


def axis_names(rig: Rig, axes: Sequence[str]) -> list[AxisName]:
    """Return the display names of the axes."""
    return [AxisName(name, rig.axes[name].bus, position_unit(rig.axes[name].kind)) for name in axes]


def make_control(rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> CoupledControl:
    """Return the controller of a run; `delays` by axis, in the order of buses and their axes."""
    axes = tuple(delays)
    law = coupling_law(rig)
    at = 0
    params = []
    for name in axes:
        params.append(axis_params(rig, name, delays[name], at))
        at += PIPE * delays[name].periods
    pairs = []
    for name in rig.coupling.pairs:
        pairs.append(pair_params(rig, name, axes, at))
        at += law.rings * rig.delay_samples
    run = run_params(rig, cycles, len(axes))
    names = axis_names(rig, axes)
    return CoupledControl(run, names, params, tuple(rig.coupling.pairs), pairs, at, law)


def slave_offset(keys: PairKeys) -> tuple[float | None, float]:
    """Return the slave position for master 0 (None: set at engagement), and the tolerance.

    The rig file gives both in master units; here they are in the slave's.
    """
    tolerance = math.inf
    if keys.engage_tolerance is not None:
        tolerance = keys.engage_tolerance * keys.position_scale
    if isinstance(keys.offset, str):
        return None, tolerance
    return -keys.sign * keys.position_scale * keys.offset, tolerance
