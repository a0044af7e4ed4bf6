"""From a rig's keys to the constants of its laws: sites and pairs."""

from __future__ import annotations

import math

from tautwave.config import Axis, Rig, Wall
from tautwave.config import Pair as PairKeys
from tautwave.laws.admittance import admittance_params
from tautwave.laws.limit import LimitParams
from tautwave.laws.port import port_params, rigid_port, sensor_allowance
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import WallParams
from tautwave.laws.wave import filter_gain
from tautwave.link.memory import DelayLine
from tautwave.runtime.loop import LoopPair
from tautwave.runtime.pair import Pair, PairScale, PositionPair, WaveFilter, WavePair
from tautwave.runtime.rates import MultiratePair, RateConverter
from tautwave.runtime.site import SiteAxis
from tautwave.types import CommandDelay

NO_WALL = WallParams(0.0, 1.0, 0.0, 0.0, controlled=False)


def pair_scale(keys: PairKeys) -> PairScale:
    """Return how slave units map to the pair's."""
    force = keys.effective_force_scale
    return PairScale(keys.position_scale, force, float(keys.sign), force * keys.position_scale)


def device_impedance(keys: PairKeys, side: str, value: float) -> float:
    """Return a wave impedance, stiffness or damping of the pair in the units of one device."""
    if side == "master":
        return value
    return value * keys.effective_force_scale / keys.position_scale


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
        # A damper B needs b >= B of the device itself (Colgate): no more than is sure to be there.
        stop_damping=axis.damping.lower,
    )


def site_params(rig: Rig, axis_name: str, delay: CommandDelay) -> SiteParams:
    """Return the constants of all laws of one axis, in the device's own units."""
    side, name = axis_name.split(".")
    axis = rig.axes[axis_name]
    keys = rig.coupling.pairs[name]
    period = rig.axis_period_s(axis_name)
    gain = velocity_gain(rig, axis)
    impedance = device_impedance(keys, side, keys.wave_impedance or 1.0)
    allowance = sensor_allowance(period, impedance, gain, axis.encoder_quantum, axis.position_noise)
    matched = keys.matched_master if side == "master" else keys.matched_slave
    if axis.inertia is not None:
        port = port_params(
            period, impedance, axis.inertia.lower, matched, keys.drift_time_s, allowance
        )
    else:
        port = rigid_port(period, impedance, keys.drift_time_s, allowance)
    wall = keys.wall_master if side == "master" else keys.wall_slave
    return SiteParams(
        port=port,
        admittance=admittance_params(
            period, impedance, axis.environment_stiffness_upper or 0.0, delay.periods
        ),
        wall=wall_params(wall),
        limit=limit_params(rig, axis),
        gain=gain,
        stiffness=device_impedance(keys, side, keys.stiffness or 0.0),
        damping=device_impedance(keys, side, keys.damping or 0.0),
        velocity_quantum=axis.velocity_quantum if axis.causality == "admittance" else 0.0,
        has_wall=wall is not None,
    )


def wave_gain(scale: PairScale, side: str) -> float:
    """Return device wave per line wave."""
    return 1.0 if side == "master" else scale.sign * math.sqrt(scale.power)


def make_site(rig: Rig, axis_name: str, delay: CommandDelay) -> SiteAxis:
    """Return one axis of the controller."""
    side, name = axis_name.split(".")
    return SiteAxis(
        site_params(rig, axis_name, delay),
        delay_periods=delay.periods,
        wave_gain=wave_gain(pair_scale(rig.coupling.pairs[name]), side),
        coupled_by_wave=rig.coupling.law == "wave",
        impedance=rig.axes[axis_name].causality == "impedance",
        late_share=delay.remainder_s / rig.axis_period_s(axis_name),
    )


def make_pair(rig: Rig, name: str, master: SiteAxis, slave: SiteAxis) -> Pair:
    """Return a pair with only the elements its rig asks for."""
    scale = pair_scale(rig.coupling.pairs[name])
    samples = rig.delay_samples
    if rig.coupling.law == "position":
        return PositionPair(name, master, slave, scale, samples)
    line = DelayLine(samples, rig.period_s) if samples else None
    filters = None
    if rig.coupling.wave_filter_hz is not None:
        gain = filter_gain(rig.coupling.wave_filter_hz, rig.period_s)
        filters = (WaveFilter(gain, rig.period_s), WaveFilter(gain, rig.period_s))
    divisors = [rig.axis_divisor(f"{side}.{name}") for side in ("master", "slave")]
    if max(divisors) == 1:
        return WavePair(name, master, slave, scale, line, filters)
    one, two = (RateConverter(n, rig.period_s) if n > 1 else None for n in divisors)
    return MultiratePair(name, master, slave, scale, line, filters, (one, two))


def make_loop_pair(rig: Rig, name: str, sites: dict[str, SiteAxis], order: list[str]) -> LoopPair:
    """Return a pair and where its samples come from."""
    keys = rig.coupling.pairs[name]
    offset, tolerance = slave_offset(keys)
    master, slave = f"master.{name}", f"slave.{name}"
    pair = make_pair(rig, name, sites[master], sites[slave])
    return LoopPair(pair, order.index(master), order.index(slave), offset, tolerance)


def slave_offset(keys: PairKeys) -> tuple[float | None, float]:
    """Return where the slave is with the master at 0 (None: at engagement), and the tolerance.

    The rig file gives both in master units; here they are in the slave's.
    """
    tolerance = math.inf
    if keys.engage_tolerance is not None:
        tolerance = keys.engage_tolerance * keys.position_scale
    if isinstance(keys.offset, str):
        return None, tolerance
    return -keys.sign * keys.position_scale * keys.offset, tolerance
