"""From a rig to what runs: the only module that knows everybody."""

from __future__ import annotations

import math
import zlib
from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.config import (
    Axis,
    Foam,
    Rig,
    SolidWall,
    Spring,
    Wall,
    axis_specs,
    simulation_of,
)
from tautwave.config import Pair as PairKeys
from tautwave.contracts import Clock, RowSource, Simulator
from tautwave.laws.admittance import admittance_params
from tautwave.laws.limit import LimitParams
from tautwave.laws.port import port_params, rigid_port, sensor_allowance
from tautwave.laws.site import SiteParams
from tautwave.laws.wall import WallParams
from tautwave.laws.wave import filter_gain
from tautwave.link.memory import DelayLine
from tautwave.models.foam import FoamParams, foam_substeps
from tautwave.models.plant_params import PlantParams
from tautwave.models.servo import ServoParams
from tautwave.motion import reference_positions
from tautwave.registry import load_driver, load_simulator
from tautwave.runtime.books import PairRow
from tautwave.runtime.loop import TIMING_COLUMNS, LoopBus, LoopPair, LoopSettings
from tautwave.runtime.pair import Pair, PairScale, PositionPair, WaveFilter, WavePair
from tautwave.runtime.site import SiteAxis
from tautwave.streams import OVERRUN, uniform_stream
from tautwave.truth import AxisModel
from tautwave.types import CommandDelay

NO_WALL = WallParams(0.0, 1.0, 0.0, 0.0, controlled=False)
SEED_WORD = 2**32  # NumPy's seeds are not negative


class Assembly(NamedTuple):
    """A rig, built. `columns` are those of a recorded row, in order."""

    clock: Clock
    settings: LoopSettings
    buses: Sequence[LoopBus]
    pairs: Sequence[LoopPair]
    sources: Sequence[RowSource]
    simulators: Sequence[Simulator]
    columns: Sequence[str]


def build_rig(rig: Rig, *, clock: str = "real", duration_s: float | None = None) -> Assembly:
    """Build everything that one run of a rig needs; touches no device.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    clock : str
        `real` or `fake`.
    duration_s : float, optional
        Length of the run [s]; the rig's own if not given.

    Raises
    ------
    ConfigError
        A driver is not installed, or a recorded reference cannot be read.
    """
    cycles = round((rig.duration_s if duration_s is None else duration_s) * rig.rate_hz)
    cycles = max(cycles, 1)
    the_clock = make_clock(rig, clock)
    models = {name: axis_model(rig, name, cycles) for name in simulated_axes(rig)}
    buses: list[LoopBus] = []
    simulators: list[Simulator] = []
    sites: dict[str, SiteAxis] = {}
    order: list[str] = []
    sources: list[RowSource] = []
    for bus_name, bus in rig.buses.items():
        plugin = load_driver(bus.driver)
        options = plugin.options.model_validate(bus.options)
        specs = axis_specs(rig, bus_name)
        transport: Any = None
        if rig.simulation is not None:
            simulator = load_simulator(bus.driver)
            world = simulator.make(
                simulator.options.model_validate(bus.options),
                specs,
                [models[spec.name] for spec in specs],
                the_clock,
            )
            simulators.append(world)
            transport = world.transport
            sources.extend(getattr(world, "axes", ()))
        driver = plugin.make(options, specs, the_clock, transport)
        for spec in specs:
            sites[spec.name] = make_site(rig, spec.name, driver.command_delay)
            order.append(spec.name)
        names = [spec.name for spec in specs]
        buses.append(LoopBus(bus_name, driver, [sites[name] for name in names], names))
    pairs = [make_loop_pair(rig, name, sites, order) for name in rig.coupling.pairs]
    rows: list[RowSource] = [PairRow(at.pair) for at in pairs]
    rows.extend(sources)
    columns = [*TIMING_COLUMNS, *(name for source in rows for name in source.columns)]
    return Assembly(the_clock, loop_settings(rig, cycles), buses, pairs, rows, simulators, columns)


def make_clock(rig: Rig, clock: str) -> Clock:
    """Return the clock of a run; a fake one oversleeps as the rig's seeded faults say."""
    if clock == "real":
        return MonotonicClock()
    faults = None if rig.simulation is None else rig.simulation.faults
    if faults is None or faults.overrun_probability == 0.0:
        return FakeClock()
    stream = uniform_stream((rig.seed % SEED_WORD, OVERRUN))
    probability = faults.overrun_probability
    late_ns = faults.overrun_slots * rig.period_ns
    return FakeClock(oversleep=lambda _: late_ns if next(stream) < probability else 0)


def loop_settings(rig: Rig, cycles: int) -> LoopSettings:
    """Return the loop's settings in cycles."""
    rate = rig.rate_hz
    return LoopSettings(
        period_ns=rig.period_ns,
        cycles=cycles,
        engage_cycles=round(rig.coupling.engage_ramp_s * rate),
        release_cycles=round(rig.coupling.release_ramp_s * rate),
        missing_limit=rig.loop.missing_limit,
        overrun_limit=rig.loop.overrun_limit,
    )


# -- the controller ----------------------------------------------------------------------------


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
    return rig.period_s / (rig.period_s + axis.velocity_filter_s)


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
        step = axis.effort_rate_limit * rig.period_s
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
    period = rig.period_s
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
        late_share=delay.remainder_s / rig.period_s,
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
    return WavePair(name, master, slave, scale, line, filters)


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


# -- the truth ---------------------------------------------------------------------------------


def simulated_axes(rig: Rig) -> Sequence[str]:
    """Return the names of all axes that are simulated."""
    return tuple(rig.axes) if rig.simulation is not None else ()


def axis_model(rig: Rig, axis_name: str, cycles: int) -> AxisModel:
    """Return the truth of one axis: device, hand at the master, environment at the slave."""
    assert rig.simulation is not None
    side, name = axis_name.split(".")
    axis = rig.axes[axis_name]
    truth = simulation_of(rig, axis_name)
    hand = rig.simulation.hand.get(name) if side == "master" else None
    environment = rig.simulation.environment.get(name) if side == "slave" else None
    mass, grip_stiffness, grip_damping = 0.0, 0.0, 0.0
    reference: Sequence[float] = ()
    if hand is not None:
        lever = hand.lever_arm if axis.kind == "rotary" and hand.lever_arm is not None else 1.0
        mass = hand.mass * lever * lever
        grip_stiffness = hand.stiffness * lever * lever
        grip_damping = hand.damping * lever * lever
        folder = Path() if rig.source is None else rig.source.parent
        # Packed: an hour at 1 kHz is 29 MB, a list of floats would be 115 MB.
        positions = reference_positions(
            hand.reference.model_dump(), rig.rate_hz, cycles + 1, folder
        )
        reference = array("d", positions.tobytes())
    spring = environment if isinstance(environment, Spring) else None
    wall = environment if isinstance(environment, SolidWall) else None
    plant = PlantParams(
        mass=(truth.inertia if axis.causality == "impedance" else 1.0) + mass,
        viscous=truth.damping,
        coulomb=truth.coulomb,
        grip_stiffness=grip_stiffness,
        grip_damping=grip_damping,
        spring_stiffness=0.0 if spring is None else spring.stiffness,
        spring_position=0.0 if spring is None else spring.position,
        wall_stiffness=0.0 if wall is None else wall.stiffness,
        wall_damping=0.0 if wall is None else wall.damping,
        wall_position=0.0 if wall is None else wall.position,
        wall_side=-1.0 if wall is not None and wall.side == "below" else 1.0,
    )
    foam = None
    if isinstance(environment, Foam):
        foam = foam_params(rig, environment, plant, truth.effort_limit)
    servo = None
    if axis.causality == "admittance":
        servo = ServoParams(
            time_constant=truth.velocity_time_constant_s,
            hand_mass=mass,
            grip_stiffness=grip_stiffness,
            grip_damping=grip_damping,
            spring_stiffness=plant.spring_stiffness,
            spring_position=plant.spring_position,
            wall_stiffness=plant.wall_stiffness,
            wall_damping=plant.wall_damping,
            wall_position=plant.wall_position,
            wall_side=plant.wall_side,
        )
    return AxisModel(
        period=rig.period_s,
        plant=plant,
        foam=foam,
        servo=servo,
        reference=reference,
        start_position=truth.start_position,
        encoder_quantum=truth.encoder_quantum,
        position_noise=truth.position_noise,
        effort_quantum=truth.effort_quantum,
        velocity_quantum=truth.velocity_quantum,
        effort_limit=truth.effort_limit,
        command_delay=truth.command_delay_s / rig.period_s,
        missing_probability=rig.simulation.faults.missing_probability,
        # By name, not by place: another axis in the rig shifts no stream.
        seed=(rig.seed % SEED_WORD, zlib.crc32(axis_name.encode())),
    )


def foam_params(rig: Rig, keys: Foam, plant: PlantParams, effort: float) -> FoamParams:
    """Return a foam with as many sub-steps as its stiffness needs at this rate.

    The greatest speed expected is what the effort limit reaches over a tenth of a second.
    """
    side = 1.0 if keys.side == "above" else -1.0
    foam = FoamParams(keys.stiffness, keys.exponent, keys.loss, keys.position, side, 1)
    speed = 0.1 * effort / plant.mass
    return foam._replace(substeps=foam_substeps(plant, foam, speed, effort, rig.period_s))
