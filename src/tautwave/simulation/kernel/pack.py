"""From a rig to the tables the kernel works on, by the functions that build a live run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.config import EnvironmentPart, Rig, has_plain_devices
from tautwave.controller.records import PIPE, AxisParams, PairParams, RunParams
from tautwave.controller.steps import Law
from tautwave.controller.stops import AxisName
from tautwave.errors import ConfigError
from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import plant_cache
from tautwave.models.sensors.effort import NO_SENSOR
from tautwave.models.servo import ServoParams
from tautwave.rig import (
    Assembly,
    axis_model,
    axis_names,
    axis_params,
    between,
    build_rig,
    check_ends,
    coupling_law,
    cycles_in,
    pair_params,
    run_params,
    true_delay_s,
)
from tautwave.simulation.kernel.records import (
    FOAM,
    HELD,
    PLANT,
    SERVO,
    DeviceParams,
    FakeParams,
)
from tautwave.streams import MISSING, NOISE, OVERRUN, SEED_WORD, SENSOR, normal_noise
from tautwave.truth import AxisModel
from tautwave.types import CommandDelay

Array = npt.NDArray[Any]
NO_FOAM = FoamParams(1.0, 1.0, 0.0, 0.0, 1.0, 1)
NO_SERVO = ServoParams(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class Job(NamedTuple):
    """A rig as tables. `axes` and `names` are those of the axes in the order of the tables.

    `start` is where the devices stand [rad or m]; `table` holds every float that is not a record
    (references, noise, commands and waves on their way), `flags` overruns and missing samples.
    """

    rig: Rig
    columns: tuple[str, ...]
    axes: tuple[str, ...]
    names: tuple[AxisName, ...]
    run: RunParams
    fake: FakeParams
    params: tuple[AxisParams, ...]
    devices: tuple[DeviceParams, ...]
    pairs: tuple[PairParams, ...]
    start: tuple[float, ...]
    table: Array
    flags: Array
    law: Law


class RigFacts(NamedTuple):
    """What only the built rig knows: columns, and the command delay of every axis, in order."""

    columns: tuple[str, ...]
    delays: dict[str, CommandDelay]


def rig_facts(rig: Rig) -> RigFacts:
    """Build one cycle's worth of the live rig; its drivers know delays, its sources columns."""
    return facts_of(build_rig(rig, clock="fake", duration_s=rig.period_s))


def facts_of(assembly: Assembly) -> RigFacts:
    """Return what only a built rig knows."""
    # What a driver records of its bus has no meaning where there is none.
    drivers = {id(bus.driver) for bus in assembly.buses}
    foreign = {
        name for source in assembly.sources if id(source) in drivers for name in source.columns
    }
    return RigFacts(
        columns=tuple(name for name in assembly.columns if name not in foreign),
        delays={name: bus.driver.command_delay for bus in assembly.buses for name in bus.axes},
    )


def pack_rig(rig: Rig, duration_s: float | None = None, facts: RigFacts | None = None) -> Job:
    """Return the tables of one run.

    Parameters
    ----------
    rig : Rig
        A checked rig with a `simulation` block.
    duration_s : float, optional
        Length of the run [s]; the rig's own if not given.
    facts : RigFacts, optional
        From `rig_facts`, where they are known already.

    Raises
    ------
    ConfigError
        The rig simulates nothing, or has a scene, or a recorded reference cannot be read.
    """
    if rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: there is nothing to simulate; add a simulation block to the rig file"
        )
    if rig.scene is not None:
        raise ConfigError(
            f"{rig.name}: a scene is simulated by the live loop only; tautwave run --clock fake"
        )
    if rig.site is not None:
        raise ConfigError(
            f"{rig.name}: this is one site's half, which is not simulated alone; leave --site"
        )
    for name, keys in rig.simulation.environment.items():
        if isinstance(keys, EnvironmentPart):
            raise ConfigError(
                f"simulation.environment.{name}: part {keys.part} is not compiled; a sweep takes "
                "the environments of tautwave itself"
            )
    if has_plain_devices(rig):
        raise ConfigError(
            f"{rig.name}: arms and loads are not compiled; tautwave run --clock fake simulates them"
        )
    cycles = cycles_in(rig, duration_s)
    built: Sequence[AxisParams] = ()  # of the controller, where it is built for the facts
    if facts is None:
        assembly = build_rig(rig, clock="fake", duration_s=rig.period_s)
        facts, built = facts_of(assembly), assembly.control.params
    delays = facts.delays
    law = coupling_law(rig)
    axes = tuple(delays)
    models = [true_model(rig, name, delays[name], cycles) for name in axes]
    if round(models[0].period * 1e9) != rig.period_ns * rig.axis_divisor(axes[0]):
        raise ConfigError(f"rate_hz: {rig.rate_hz!r} has no period in whole ns; use a rounder rate")
    faults = rig.simulation.faults
    floats = Pieces(np.float64)
    flags = Pieces(np.bool_)
    flags.add(draw_overruns(rig.seed, faults.overrun_probability, cycles))
    controlled = []
    devices = []
    for which, (name, model) in enumerate(zip(axes, models, strict=True)):
        at = floats.add(np.zeros(PIPE * delays[name].periods))
        if built:
            controlled.append(built[which]._replace(pipe=at))
        else:
            controlled.append(sound_axis(rig, name, delays, at))
        devices.append(pack_device(model, floats, flags, cycles))
    pairs = []
    for name in rig.coupling.pairs:
        link, content = between(rig, name, floats.size)
        at = floats.add(np.array(content))
        pairs.append(pair_params(rig, name, axes, at, link))
    return Job(
        rig=rig,
        columns=facts.columns,
        axes=axes,
        names=tuple(axis_names(rig, axes)),
        run=run_params(rig, cycles, len(axes)),
        fake=fake_params(rig),
        params=tuple(controlled),
        devices=tuple(devices),
        pairs=tuple(pairs),
        start=tuple(model.start_position for model in models),
        table=floats.join(),
        flags=flags.join(),
        law=law,
    )


def sound_axis(rig: Rig, name: str, delays: Mapping[str, CommandDelay], pipe: int) -> AxisParams:
    """Return the constants of an axis; what is wrong of any axis is said of all."""
    try:
        return axis_params(rig, name, delays[name], pipe)
    except ConfigError:
        check_ends(rig, delays)
        raise


def true_model(rig: Rig, axis_name: str, declared: CommandDelay, cycles: int) -> AxisModel:
    """Return the truth of one axis, its command delay on this bus included."""
    model = axis_model(rig, axis_name, cycles)
    late = true_delay_s(rig, axis_name, declared) / rig.axis_period_s(axis_name)
    return model._replace(command_delay=late)


class Pieces:
    """A table in the making: pieces laid end to end."""

    def __init__(self, kind: type[Any]) -> None:
        self._kind = kind
        self._pieces: list[Array] = []
        self.size = 0

    def add(self, piece: Array) -> int:
        """Add a piece and return the index of its first number."""
        at = self.size
        self._pieces.append(piece)
        self.size += len(piece)
        return at

    def join(self) -> Array:
        """Return the table, never empty."""
        return np.concatenate([*self._pieces, np.zeros(1)]).astype(self._kind)


def fake_params(rig: Rig) -> FakeParams:
    """Return what is simulated of the host; whole rows are kept."""
    assert rig.simulation is not None
    faults = rig.simulation.faults
    return FakeParams(faults.overrun_slots, faults.overrun_probability > 0.0, -1)


def pack_device(model: AxisModel, floats: Pieces, flags: Pieces, cycles: int) -> DeviceParams:
    """Return the truth of one axis, as a simulated axis reads it; its tables are added."""
    assert model.part is None, "an environment that is a part has no compiled device"
    whole = math.floor(model.command_delay + 1e-9)
    share = model.command_delay - whole
    kind = PLANT
    if model.imposed:
        kind = HELD
    elif model.servo is not None:
        kind = SERVO
    elif model.foam is not None:
        kind = FOAM
    return DeviceParams(
        plant=model.plant,
        cache=plant_cache(model.plant, model.period),
        foam=NO_FOAM if model.foam is None else model.foam,
        servo=NO_SERVO if model.servo is None else model.servo,
        kind=kind,
        period=model.period,
        late=share if share > 1e-9 else 0.0,
        encoder_quantum=model.encoder_quantum,
        position_noise=model.position_noise,
        effort_quantum=model.effort_quantum,
        velocity_quantum=model.velocity_quantum,
        effort_limit=model.effort_limit,
        delay=whole,
        pipe=floats.add(np.zeros(whole)),
        reference=floats.add(np.asarray(model.reference, dtype=np.float64)),
        last=len(model.reference) - 1,
        noise=floats.add(draw_noise(model, cycles)),
        missing=flags.add(draw_missing(model, cycles)),
        loses=model.missing_probability > 0.0,
        push=floats.add(np.asarray(model.push, dtype=np.float64)),
        pushes=len(model.push),
        senses=model.sensor is not None,
        sensor=NO_SENSOR if model.sensor is None else model.sensor,
        sensed=floats.add(np.zeros(0 if model.sensor is None else model.sensor.delay)),
        sensor_noise=floats.add(draw_sensor_noise(model, cycles)),
    )


def draw_noise(model: AxisModel, cycles: int) -> Array:
    """Return the position noise of every cycle, of standard deviation 1; nothing without noise."""
    if model.position_noise == 0.0:
        return np.zeros(0)
    return normal_noise((*model.seed, NOISE), cycles, model.colour)


def draw_sensor_noise(model: AxisModel, cycles: int) -> Array:
    """Return the effort sensor's noise of every cycle, of standard deviation 1."""
    if model.sensor is None or model.sensor.noise == 0.0:
        return np.zeros(0)
    return normal_noise((*model.seed, SENSOR), cycles, ())


def draw_missing(model: AxisModel, cycles: int) -> Array:
    """Return which samples are missing; the first never is, and nothing is drawn for it."""
    if model.missing_probability == 0.0:
        return np.zeros(0)
    draws = np.random.default_rng((*model.seed, MISSING)).random(cycles - 1)
    return np.append(False, draws < model.missing_probability)


def draw_overruns(seed: int, probability: float, cycles: int) -> Array:
    """Return after which cycles the loop oversleeps."""
    if probability == 0.0:
        return np.zeros(0)
    draws = np.random.default_rng((seed % SEED_WORD, OVERRUN)).random(cycles)
    return np.asarray(draws < probability)
