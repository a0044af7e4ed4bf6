"""From a rig to the tables the kernel works on, by the functions that build a live run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.errors import ConfigError
from tautwave.laws.wave import filter_gain
from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import plant_cache
from tautwave.models.servo import ServoParams
from tautwave.offline.records import (
    FOAM,
    PLANT,
    SERVO,
    DeviceParams,
    PairParams,
    RunParams,
    SideParams,
)
from tautwave.rig import (
    SEED_WORD,
    axis_model,
    build_rig,
    loop_settings,
    pair_scale,
    site_params,
    slave_offset,
    true_delay_s,
    wave_gain,
)
from tautwave.runtime.loop import ARM_SHARE, ARM_TIMEOUT_S
from tautwave.streams import MISSING, NOISE, OVERRUN
from tautwave.truth import AxisModel
from tautwave.types import CommandDelay

Array = npt.NDArray[Any]
NO_FOAM = FoamParams(1.0, 1.0, 0.0, 0.0, 1.0, 1)
NO_SERVO = ServoParams(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


class Job(NamedTuple):
    """A rig as tables. `axes` and `buses` name axes and their buses in the order of the tables.

    `start` is where the devices stand [rad or m]; `table` holds every float that is no record
    (references, noise, commands and waves on their way), `flags` overruns and missing samples.
    """

    rig: Rig
    columns: tuple[str, ...]
    axes: tuple[str, ...]
    buses: tuple[str, ...]
    run: RunParams
    sides: tuple[SideParams, ...]
    devices: tuple[DeviceParams, ...]
    pairs: tuple[PairParams, ...]
    start: tuple[float, ...]
    table: Array
    flags: Array


class RigFacts(NamedTuple):
    """What only the built rig knows: columns, and by axis its command delay and its bus."""

    columns: tuple[str, ...]
    delays: dict[str, CommandDelay]
    buses: tuple[str, ...]


def rig_facts(rig: Rig) -> RigFacts:
    """Build one cycle's worth of the live rig; its drivers know delays, its sources columns."""
    assembly = build_rig(rig, clock="fake", duration_s=rig.period_s)
    # What a driver records of its bus has no meaning where there is none.
    drivers = {id(bus.driver) for bus in assembly.buses}
    foreign = {
        name for source in assembly.sources if id(source) in drivers for name in source.columns
    }
    return RigFacts(
        columns=tuple(name for name in assembly.columns if name not in foreign),
        delays={name: bus.driver.command_delay for bus in assembly.buses for name in bus.axes},
        buses=tuple(bus.name for bus in assembly.buses for _ in bus.axes),
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
    cycles = max(round((rig.duration_s if duration_s is None else duration_s) * rig.rate_hz), 1)
    facts = rig_facts(rig) if facts is None else facts
    delays = facts.delays
    axes = tuple(delays)
    models = [true_model(rig, name, delays[name], cycles) for name in axes]
    if round(models[0].period * 1e9) != rig.period_ns * rig.axis_divisor(axes[0]):
        raise ConfigError(f"rate_hz: {rig.rate_hz!r} has no period in whole ns; use a rounder rate")
    faults = rig.simulation.faults
    floats = Pieces(np.float64)
    flags = Pieces(np.bool_)
    flags.add(draw_overruns(rig.seed, faults.overrun_probability, cycles))
    sides = []
    devices = []
    for name, model in zip(axes, models, strict=True):
        at = floats.add(np.zeros(4 * delays[name].periods))
        sides.append(pack_side(rig, name, delays[name], at))
        devices.append(pack_device(model, floats, flags, cycles))
    pairs = []
    for name in rig.coupling.pairs:
        at = floats.add(np.zeros(4 * rig.delay_samples))
        pairs.append(pack_pair(rig, name, axes, at))
    return Job(
        rig=rig,
        columns=facts.columns,
        axes=axes,
        buses=facts.buses,
        run=pack_run(rig, cycles, len(axes), len(pairs)),
        sides=tuple(sides),
        devices=tuple(devices),
        pairs=tuple(pairs),
        start=tuple(model.start_position for model in models),
        table=floats.join(),
        flags=flags.join(),
    )


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
        self._size = 0

    def add(self, piece: Array) -> int:
        """Add a piece and return the index of its first number."""
        at = self._size
        self._pieces.append(piece)
        self._size += len(piece)
        return at

    def join(self) -> Array:
        """Return the table, never empty."""
        return np.concatenate([*self._pieces, np.zeros(1)]).astype(self._kind)


def pack_run(rig: Rig, cycles: int, axes: int, pairs: int) -> RunParams:
    """Return length, ramps and limits of the run."""
    assert rig.simulation is not None
    faults = rig.simulation.faults
    settings = loop_settings(rig, cycles)
    return RunParams(
        period_ns=settings.period_ns,
        cycles=settings.cycles,
        axes=axes,
        pairs=pairs,
        engage_cycles=settings.engage_cycles,
        release_cycles=settings.release_cycles,
        missing_limit=settings.missing_limit,
        overrun_limit=settings.overrun_limit,
        overrun_slots=faults.overrun_slots,
        overruns=faults.overrun_probability > 0.0,
        arm_share=ARM_SHARE,
        arm_timeout_ns=ARM_TIMEOUT_S * 1e9,
        measured=-1,
    )


def pack_side(rig: Rig, axis_name: str, delay: CommandDelay, pipe: int) -> SideParams:
    """Return one axis of the controller; as `rig.make_site`."""
    side, name = axis_name.split(".")
    scale = pair_scale(rig.coupling.pairs[name])
    site = site_params(rig, axis_name, delay)
    impedance = rig.axes[axis_name].causality == "impedance"
    return SideParams(
        site=site,
        wave=wave_gain(scale, side),
        half_period=0.5 * site.port.period,
        late=delay.remainder_s / rig.axis_period_s(axis_name),
        ceiling=site.limit.effort if impedance else site.limit.velocity,
        weight=1.0 if side == "master" else 1.0 / scale.power,
        delay=delay.periods,
        pipe=pipe,
        by_wave=rig.coupling.law == "wave",
        impedance=impedance,
        divisor=rig.axis_divisor(axis_name),
        rated=is_rated(rig, name),
        line_half=0.5 * rig.period_s,
    )


def is_rated(rig: Rig, name: str) -> bool:
    """Return whether a side of a pair is slow."""
    return max(rig.axis_divisor(f"{side}.{name}") for side in ("master", "slave")) > 1


def pack_device(model: AxisModel, floats: Pieces, flags: Pieces, cycles: int) -> DeviceParams:
    """Return the truth of one axis, as a simulated axis reads it; its tables are added."""
    whole = math.floor(model.command_delay + 1e-9)
    share = model.command_delay - whole
    kind = PLANT
    if model.servo is not None:
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
    )


def pack_pair(rig: Rig, name: str, axes: Sequence[str], line: int) -> PairParams:
    """Return one pair; as `rig.make_loop_pair`."""
    keys = rig.coupling.pairs[name]
    scale = pair_scale(keys)
    offset, tolerance = slave_offset(keys)
    samples = rig.delay_samples
    corner = rig.coupling.wave_filter_hz
    return PairParams(
        master=axes.index(f"master.{name}"),
        slave=axes.index(f"slave.{name}"),
        by_wave=rig.coupling.law == "wave",
        filtered=corner is not None and rig.coupling.law == "wave",
        rated=is_rated(rig, name),
        at_engage=offset is None,
        ratio=scale.sign * scale.scale,
        sign=scale.sign,
        force_scale=scale.force_scale,
        to_master=scale.sign / scale.scale,
        weight=1.0 / scale.power,
        period=rig.period_s,
        half_period=0.5 * rig.period_s,
        filter_gain=1.0 if corner is None else filter_gain(corner, rig.period_s),
        offset=0.0 if offset is None else offset,
        tolerance=tolerance,
        samples=samples,
        line=line,
    )


def draw_noise(model: AxisModel, cycles: int) -> Array:
    """Return the position noise of every cycle, of standard deviation 1; nothing without noise."""
    if model.position_noise == 0.0:
        return np.zeros(0)
    return np.random.default_rng((*model.seed, NOISE)).standard_normal(cycles)


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
