"""From a rig's `simulation` block to the truth of each axis: device, hand, environment."""

from __future__ import annotations

import math
import zlib
from array import array
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave import registry
from tautwave.config import (
    Axis,
    EnvironmentPart,
    Foam,
    Hand,
    HandPart,
    Intent,
    Pointer,
    Policy,
    Recorded,
    Rig,
    SolidWall,
    Spring,
    imposed_motions,
    simulation_of,
    true_arm,
)
from tautwave.errors import ConfigError
from tautwave.laws.lead import LeadParams
from tautwave.models.foam import FoamParams, foam_substeps
from tautwave.models.part_contact import PartContact, part_substeps
from tautwave.models.plant_params import PlantParams
from tautwave.models.sensors.effort import SensorParams, sensor_keep
from tautwave.models.servo import ServoParams
from tautwave.motion import recorded_efforts, reference_positions
from tautwave.recordings.stated import stated_in
from tautwave.rig.arms import arm_chain, load_params
from tautwave.rig.integration import Integrated, integrated
from tautwave.streams import HAND, SEED_WORD
from tautwave.truth import ArmModel, AxisModel, PositionLoop
from tautwave.types import Imposed

if TYPE_CHECKING:
    from tautwave.runtime.operate.lead import Lead

POINTER_S = 1.0 / 60.0
"""Time in which a hand goes to where a page's pointer was last [s]."""

LIGHTEST = 1e-30
"""Inertia below which powers of rates and periods leave the range of floats, SI."""


def axis_model(rig: Rig, axis_name: str, cycles: int) -> AxisModel:
    """Return the truth of one axis: device, hand at the master, environment at the slave."""
    assert rig.simulation is not None
    side, name = axis_name.split(".")
    axis = rig.axes[axis_name]
    _refuse_spare_truth(rig, axis_name)
    truth = simulation_of(rig, axis_name)
    period = rig.axis_period_s(axis_name)
    hand = rig.simulation.hand.get(name) if side == "master" else None
    environment = rig.simulation.environment.get(name) if side == "slave" else None
    mass, grip_stiffness, grip_damping = 0.0, 0.0, 0.0
    reference: Sequence[float] = ()
    lead: Lead | None = None
    motion = imposed_motion(rig, axis_name)
    if motion is not None:
        if hand is not None or environment is not None:
            key = "hand" if hand is not None else "environment"
            raise ConfigError(
                f"simulation.{key}.{name}: nothing else moves {axis_name}, which moves as "
                "recorded; remove it"
            )
        keys = {**motion._asdict(), "type": "recording", "column": motion.position}
        reference = _at_slots(rig, axis_name, keys, cycles)
    if hand is not None:
        lever = hand.lever_arm if axis.kind == "rotary" and hand.lever_arm is not None else 1.0
        mass = hand.mass * lever * lever
        grip_stiffness = hand.stiffness * lever * lever
        grip_damping = hand.damping * lever * lever
        leader = getattr(hand, "reference", None)
        if isinstance(leader, Policy | Pointer):
            reference = (truth.start_position,)
            lead = _lead(axis, leader, grip_stiffness, truth.start_position, period)
        else:
            reference = wanted_positions(rig, axis_name, hand, cycles)
    push: Sequence[float] = ()
    if isinstance(environment, Recorded):
        push = recorded_push(rig, axis_name, environment, cycles)
    spring = environment if isinstance(environment, Spring) else None
    wall = environment if isinstance(environment, SolidWall) else None
    plain = axis.causality == "impedance" or axis.follower is not None
    plant = PlantParams(
        mass=(truth.inertia if plain else 1.0) + mass,
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
    if plant.mass < LIGHTEST:
        raise ConfigError(
            f"simulation.axes.{axis_name}.inertia: {plant.mass:g} with its hand is too small to "
            f"simulate; use {LIGHTEST:g} or more"
        )
    foam = None
    if isinstance(environment, Foam):
        foam = foam_params(period, environment, plant, truth.effort_limit)
    integrator = rig.simulation.integrator
    at_part = isinstance(environment, EnvironmentPart)
    if integrator is not None and plain and not at_part:
        speed = greatest_speed(rig, axis_name, plant.mass)
        foam = integrated(axis_name, integrator, plant, foam, speed, period).foam
    arm = true_arm(rig, axis_name)
    part = None
    if isinstance(environment, EnvironmentPart):
        part = part_contact(rig, axis_name, environment, plant)
    servo = None
    if not plain:
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
        period=period,
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
        command_delay=truth.command_delay_s / period,
        missing_probability=rig.simulation.faults.missing_probability,
        seed=_seed(rig, axis_name),
        part=part,
        colour=truth.position_noise_autocorrelation,
        load=None if truth.load is None else load_params(truth.load),
        arm=None if arm is None else ArmModel(arm[0], arm_chain(arm[1])),
        imposed=motion is not None,
        push=push,
        sensor=sensor_params(rig, axis_name, mass),
        loop=None
        if axis.follower is None
        else PositionLoop(truth.servo_stiffness, truth.servo_damping),
        lead=lead,
    )


def _refuse_spare_truth(rig: Rig, axis_name: str) -> None:
    """Refuse truth stated for an axis that its driver derives from others, which hold it."""
    assert rig.simulation is not None
    bus = rig.axes[axis_name].bus
    if not registry.load_driver(rig.buses[bus].driver).plain:
        return
    others = {name: keys for name, keys in rig.simulation.axes.items() if name != axis_name}
    bare = rig.simulation.model_copy(update={"axes": others})
    believed = simulation_of(rig.model_copy(update={"simulation": bare}), axis_name)._asdict()
    if rig.axes[axis_name].causality == "admittance":
        del believed["velocity_time_constant_s"]  # the drives' of all joints
    for key, value in simulation_of(rig, axis_name)._asdict().items():
        if value != believed.get(key, value):
            raise ConfigError(
                f"simulation.axes.{axis_name}.{key}: a simulated tip is moved by its joints; "
                f"state their truth in buses.{bus}.options.truth, and remove this"
            )
    if rig.simulation.integrator is not None:
        raise ConfigError("simulation.integrator: a simulated arm has its own; remove it")


def _lead(
    axis: Axis, keys: Policy | Pointer, stiffness: float, start: float, period: float
) -> Lead:
    """Return what a hand wants that a policy or a pointer leads."""
    from tautwave.runtime.operate.lead import Lead, Pointed  # few rigs have one

    low, high = (-math.inf, math.inf) if axis.position_range is None else axis.position_range
    reach = keys.effort_limit / stiffness
    if isinstance(keys, Policy):
        params = LeadParams(1.0 / keys.fps, keys.velocity_limit, reach, low, high)
        return Lead(params, start, period)
    if keys.range is not None:
        low, high = max(low, keys.range[0]), min(high, keys.range[1])
    params = LeadParams(POINTER_S, keys.velocity_limit, reach, low, high)
    return Pointed(params, start, period, keys.timeout_s)


def sensor_params(rig: Rig, axis_name: str, mass: float) -> SensorParams | None:
    """Return the true effort sensor of an axis, with a `mass` beyond it; None without one."""
    keys = simulation_of(rig, axis_name).effort_sensor
    if keys is None:
        return None
    period = rig.axis_period_s(axis_name)
    return SensorParams(
        mass=mass,
        keep=sensor_keep(keys.bandwidth_hz, period),
        delay=round(keys.delay_s / period),
        scale=keys.scale,
        offset=keys.offset,
        noise=keys.noise,
        quantum=keys.quantum,
    )


def imposed_motion(rig: Rig, axis_name: str) -> Imposed | None:
    """Return the recorded motion along which its bus forces an axis, None where it does not."""
    bus = rig.axes[axis_name].bus
    plugin = registry.load_driver(rig.buses[bus].driver)
    if plugin.imposed is None:
        return None
    return imposed_motions(rig.model_copy(update={"buses": {bus: rig.buses[bus]}}), {bus: plugin})[
        axis_name
    ]


def recorded_push(rig: Rig, axis_name: str, keys: Recorded, cycles: int) -> Sequence[float]:
    """Return the recorded effort on an axis at every slot [N m or N].

    Raises
    ------
    ConfigError
        The recording cannot be read.
    """
    period = rig.axis_period_s(axis_name)
    slots = np.arange(cycles // rig.axis_divisor(axis_name) + 2, dtype=np.float64)
    efforts = recorded_efforts(
        Path(keys.file), keys.effort, keys.time_column, slots * period,
        repeat=keys.repeat, stated=stated_in(keys),
    )  # fmt: skip
    return array("d", (keys.scale * efforts + keys.offset).tobytes())


def _at_slots(
    rig: Rig, axis_name: str, reference: Mapping[str, Any], cycles: int
) -> Sequence[float]:
    """Return a reference at every slot of an axis, and one more."""
    divisor = rig.axis_divisor(axis_name)
    folder = Path() if rig.source is None else rig.source.parent
    positions = reference_positions(reference, rig.rate_hz / divisor, cycles // divisor + 1, folder)
    # Packed: an hour at 1 kHz is 29 MB, a list of floats would be 115 MB.
    return array("d", positions.tobytes())


def wanted_positions(
    rig: Rig, axis_name: str, hand: Hand | HandPart, cycles: int
) -> Sequence[float]:
    """Return the hand's wanted position at every slot of its axis [rad or m].

    Raises
    ------
    ConfigError
        A recording cannot be read, or a part fails or returns non-finite positions.
    """
    if isinstance(hand, Hand):
        keys = hand.reference.model_dump()
        if isinstance(hand.reference, Intent):
            square = 1.0 if hand.lever_arm is None else hand.lever_arm**2
            keys["grip"] = [square * value for value in (hand.mass, hand.damping, hand.stiffness)]
        return _at_slots(rig, axis_name, keys, cycles)
    divisor = rig.axis_divisor(axis_name)
    rate, last = rig.rate_hz / divisor, cycles // divisor + 1
    place = f"simulation.hand.{axis_name.split('.')[1]}: part {hand.part}"
    motion = registry.load_named(registry.load_part(registry.HANDS, hand.part).motion)
    times = [slot / rate for slot in range(last + 1)]
    try:
        wanted = array("d", motion(hand, times, (*_seed(rig, axis_name), HAND)))
    except Exception as err:
        raise ConfigError(f"{place}: its motion fails: {type(err).__name__}: {err}") from err
    if len(wanted) != len(times):
        raise ConfigError(f"{place}: {len(wanted)} positions for {len(times)} times")
    for time, position in zip(times, wanted, strict=True):
        if not math.isfinite(position):
            raise ConfigError(f"{place}: its reference is {position} at {time:g} s")
    return wanted


def part_contact(
    rig: Rig, axis_name: str, keys: EnvironmentPart, plant: PlantParams
) -> PartContact:
    """Return the contact model of an environment part, with the sub-steps it needs.

    Raises
    ------
    ConfigError
        The axis takes velocities, or the part fails or returns non-finite numbers.
    """
    place = f"simulation.environment.{axis_name.split('.')[1]}: part {keys.part}"
    axis = rig.axes[axis_name]
    if axis.causality != "impedance" and axis.follower is None:
        raise ConfigError(f"{place}: only for axes that take effort or positions")
    plugin = registry.load_part(registry.ENVIRONMENTS, keys.part)
    params, force, stored, kinks = (
        registry.load_named(named)
        for named in (plugin.params, plugin.force, plugin.stored, plugin.kinks)
    )
    integrator = rig.simulation.integrator if rig.simulation is not None else None
    error = 1e-4 if integrator is None or integrator.max_error is None else integrator.max_error
    start = simulation_of(rig, axis_name).start_position
    speed = greatest_speed(rig, axis_name, plant.mass)
    try:
        p = tuple(float(value) for value in params(keys))
        edges = tuple(sorted(float(kink) for kink in kinks(p))) if kinks is not None else ()
        _look_for_nan(p, force, stored, (start, *edges), speed)
        part = PartContact(p, force, stored, edges)
        steps = part_substeps(plant, part, start, speed, rig.axis_period_s(axis_name), error)
    except Exception as err:
        raise ConfigError(f"{place}: it fails: {type(err).__name__}: {err}") from err
    return part._replace(substeps=steps)


def _look_for_nan(
    p: tuple[float, ...],
    force: Callable[[tuple[float, ...], float, float], float],
    stored: Callable[[tuple[float, ...], float], float],
    places: Sequence[float],
    speed: float,
) -> None:
    for x in places:
        for v in (0.0, speed, -speed):
            if not math.isfinite(force(p, x, v) + stored(p, x)):
                raise ValueError(f"force or energy is not finite at position {x:g}, velocity {v:g}")


def _seed(rig: Rig, axis_name: str) -> tuple[int, int]:
    # Seeded by name, not position: adding an axis does not shift other streams.
    return (rig.seed % SEED_WORD, zlib.crc32(axis_name.encode()))


def greatest_speed(rig: Rig, axis_name: str, mass: float) -> float:
    """Return the greatest impact speed of an axis [m/s or rad/s].

    Its velocity limit; without one, the speed its motor reaches in a tenth of a second.
    """
    limit = rig.axes[axis_name].velocity_limit
    if limit is not None:
        return limit
    return 0.1 * simulation_of(rig, axis_name).effort_limit / mass


def axis_integration(rig: Rig, axis_name: str) -> Integrated:
    """Return how an impedance axis of a rig with `simulation.integrator` is integrated, and why.

    Raises
    ------
    ConfigError
        The scheme cannot integrate the axis' contact.
    """
    assert rig.simulation is not None
    keys = rig.simulation.integrator
    assert keys is not None
    bare = rig.model_copy(
        update={"simulation": rig.simulation.model_copy(update={"integrator": None})}
    )
    model = axis_model(bare, axis_name, 1)
    speed = greatest_speed(rig, axis_name, model.plant.mass)
    return integrated(axis_name, keys, model.plant, model.foam, speed, model.period)


def foam_params(period: float, keys: Foam, plant: PlantParams, effort: float) -> FoamParams:
    """Return a foam with as many sub-steps as its stiffness needs at this rate.

    The greatest speed expected is that reached at the effort limit in a tenth of a second.
    """
    side = 1.0 if keys.side == "above" else -1.0
    foam = FoamParams(keys.stiffness, keys.exponent, keys.loss, keys.position, side, 1)
    speed = 0.1 * effort / plant.mass
    return foam._replace(substeps=foam_substeps(plant, foam, speed, effort, period))
