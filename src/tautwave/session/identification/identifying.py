"""`identify RIG`: excite one axis within its limits, and fit its inertia and friction."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tautwave.config import Rig, axis_damper, resolved_yaml
from tautwave.errors import (
    BusBudgetError,
    ConfigError,
    RecordingError,
    SafetyStop,
    TautwaveError,
    WritingError,
)
from tautwave.files import make_directory, write_text
from tautwave.registry import load_driver
from tautwave.rig import Simulate, Way, as_taken, build_rig, bus_ways
from tautwave.runtime.interrupts import Interrupted, interrupts
from tautwave.runtime.loop import Loop
from tautwave.runtime.machine import quiet_collector
from tautwave.runtime.recorder import Recorder
from tautwave.runtime.unwatched import refuse_enabled
from tautwave.session.certified import certificate_of, refuse_uncertified
from tautwave.session.checking import bus_budgets, over_budget, require_drivers
from tautwave.session.devices import devices
from tautwave.session.identification.exciting import (
    Excitation,
    Mover,
    Plan,
    excite,
    plan_excitation,
)
from tautwave.session.identification.slots import axis_slots
from tautwave.session.metadata import metadata_of
from tautwave.session.running import loop_conditions
from tautwave.types import CommandDelay

if TYPE_CHECKING:  # analysis is imported only when the axis is safe again
    from tautwave.analysis.identification.device_model import DeviceFit
    from tautwave.analysis.identification.regression import Estimate

AND = ", "
"""Between the names of axes that are excited together."""
CAUTION = 0.8
"""Factor on the interval's lower end, for changes after the measurement."""


class DeviceResult(NamedTuple):
    """An identified device: the fit, its excitation, its files."""

    axis: str
    kind: str
    fit: DeviceFit
    plan: Plan
    duration_s: float
    notes: list[str]
    directory: Path
    interrupted: bool

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        fit = self.fit
        return {
            "kind": "device",
            "axis": self.axis,
            "axis_kind": self.kind,
            "duration_s": self.duration_s,
            "parameters": {
                name: interval(getattr(fit, name))
                for name in ("inertia", "damping", "coulomb", "bias")
            },
            "residual_rms": fit.residual_rms,
            "explained": fit.explained,
            "sensor_noise": fit.sensor_noise,
            "peak_velocity": fit.peak_velocity,
            "excitation": {
                "greatest_effort": self.plan.effort,
                "reach": self.plan.reach,
                "highest_hz": self.plan.highest_hz,
            },
            "beliefs": {} if self.implausible else beliefs(fit),
            "snippet": self.snippet,
            "notes": self.notes,
            "interrupted": self.interrupted,
            "directory": str(self.directory),
        }

    @property
    def snippet(self) -> str:
        """Lines for the axis in the rig file."""
        if self.implausible:
            return f"# {self.axis}: nothing here is credible, see the notes"
        return device_snippet(self.axis, self.fit)

    @property
    def implausible(self) -> list[str]:
        """A sentence for each number that is outside physics."""
        from tautwave.analysis.identification.plausible import implausible

        return implausible(device_numbers(self.fit), self.kind == "rotary")


def interval(estimate: Estimate) -> dict[str, float]:
    """An estimate for JSON."""
    return estimate._asdict()


def device_numbers(fit: DeviceFit) -> dict[str, float]:
    """Return what a fit says of a device and its motion, by the names of their bounds [SI]."""
    names = ("inertia", "damping", "coulomb", "bias")
    numbers = {name: float(getattr(fit, name).value) for name in names}
    return numbers | {"peak_velocity": fit.peak_velocity}


def beliefs(fit: DeviceFit) -> dict[str, dict[str, Any]]:
    """Return `inertia`, `damping` and `coulomb` as a rig file takes them."""
    blocks: dict[str, dict[str, Any]] = {}
    for name in ("inertia", "damping", "coulomb"):
        estimate = getattr(fit, name)
        value = _round(max(estimate.value, 0.0))
        lower = _round(CAUTION * max(estimate.lower, 0.0), down=True)
        blocks[name] = {"value": value, "lower": min(lower, value), "source": "identified"}
    return blocks


def _round(value: float, *, down: bool = False) -> float:
    """Four significant digits."""
    if value <= 0.0:
        return 0.0
    unit = 10.0 ** (math.floor(math.log10(value)) - 3)
    count = math.floor(value / unit) if down else round(value / unit)
    return float(f"{count * unit:.4g}")


def device_snippet(axis: str, fit: DeviceFit) -> str:
    """Return the lines to paste under the axis in the rig file."""
    half = 0.5 * (fit.coulomb.upper - fit.coulomb.lower)
    lines = [f"# {axis}; Coulomb friction {fit.coulomb.value:.3g} +- {half:.1g}"]
    for name, belief in beliefs(fit).items():
        value, lower = (f"{belief[key]:.4g}" for key in ("value", "lower"))
        lines.append(f"{name}: {{value: {value}, lower: {lower}, source: identified}}")
    return "\n".join(lines)


def axis_to_identify(rig: Rig, name: str | None) -> str:
    """Return the named axis, or the only one.

    Raises
    ------
    ConfigError
        No such axis, several to choose from, or one that cannot be excited.
    """
    able = [key for key, axis in rig.axes.items() if axis.causality == "impedance"]
    if name is None:
        if len(able) == 1:
            return able[0]
        if not able:
            raise ConfigError(
                f"{rig.name}: no axis is effort-controlled, so none can be identified"
            )
        raise ConfigError(f"{rig.name}: choose an axis with --axis: {', '.join(able)}")
    if name not in rig.axes:
        raise ConfigError(f"{rig.name}: there is no axis {name!r}; there are {', '.join(rig.axes)}")
    if name not in able:
        raise ConfigError(
            f"{name} is an admittance axis: it is commanded by velocity, so its inertia is not "
            f"observable"
        )
    if rig.axes[name].position_range is None:
        raise ConfigError(
            f"{name} has no position_range, which excitation requires; add it to the rig, or "
            f"give --set '{_key(name)}.position_range=[LOW, HIGH]'"
        )
    if axis_damper(rig, name) is not None:
        raise ConfigError(
            f"{name} has a damper in its motor, which would count as the device's own; identify "
            f"without it: remove damping from the options of bus {rig.axes[name].bus!r}"
        )
    return name


def _key(name: str) -> str:
    side, _, axis = name.partition(".")
    return f"{side}.axes.{axis}"


def identify_device(
    rig: Rig,
    *,
    axis: str | None = None,
    out: Path,
    clock: str = "real",
    duration_s: float = 12.0,
    share: float = 0.3,
    reach: float | None = None,
    allow_uncertified: bool = False,
    simulate: Simulate = (),
    attach: bool = False,
    progress: Callable[[float, str], None] | None = None,
) -> DeviceResult:
    """Excite one axis of a rig and fit inertia, viscous and Coulomb friction.

    Coupling or scene are off; all other axes are enabled and get no effort. A simulated hand and
    environment are removed. Driver, limits, guards, ramps and the safe end are those of a run.

    Parameters
    ----------
    axis : str, optional
        Such as `master.wrist`; needed if there are several.
    out : Path
        Directory for rig.yaml, recording.mcap and identification.json.
    clock : str
        `real` or `fake`.
    duration_s : float
        [s].
    share : float
        Greatest effort as a share of the axis' limit.
    reach : float, optional
        How far from the start it may swing [rad or m]; a quarter of the range if not given.
    allow_uncertified : bool
        Move motors of a rig without a certificate. simulate, attach As for `session.run`.

    Raises
    ------
    TautwaveError
        The rig is refused, the run ended in a fault or a stop, or the device did not move enough.
    """
    name = axis_to_identify(rig, axis)
    results = identify_together(
        rig, [name], out=out, clock=clock, duration_s=duration_s, share=share, reach=reach,
        allow_uncertified=allow_uncertified, simulate=simulate, attach=attach, progress=progress,
    )[name]  # fmt: skip
    if isinstance(results, RecordingError):
        raise results
    return results


def identify_together(
    rig: Rig,
    names: Sequence[str],
    *,
    out: Path,
    clock: str = "real",
    duration_s: float = 12.0,
    share: float = 0.3,
    reach: float | None = None,
    allow_uncertified: bool = False,
    allow_unwatched: bool = False,
    simulate: Simulate = (),
    attach: bool = False,
    progress: Callable[[float, str], None] | None = None,
) -> dict[str, DeviceResult | RecordingError]:
    """Excite several axes in one run, which no mechanism connects, and fit each alone.

    Parameters are those of `identify_device`; `allow_unwatched` as for a run. One that did not move
    enough has its error in the result instead.

    Raises
    ------
    TautwaveError
        The rig is refused, or the run ended in a fault or a stop.
    """
    cycles = max(round(duration_s * rig.rate_hz), 1)
    plans = {
        name: plan_excitation(rig, axis_to_identify(rig, name), cycles, share=share, reach=reach)
        for name in names
    }
    run = record_excitation(
        rig,
        AND.join(names),
        {name: Excitation(plan) for name, plan in plans.items()},
        out=out,
        clock=clock,
        duration_s=duration_s,
        allow_uncertified=allow_uncertified,
        allow_unwatched=allow_unwatched,
        simulate=simulate,
        attach=attach,
        progress=progress,
    )
    if progress is not None:
        progress(1.0, "fitting")
    results: dict[str, DeviceResult | RecordingError] = {}
    for name, plan in plans.items():
        try:
            with run.heard.raised():
                fit = fit_recorded(
                    out / "recording.mcap", name, run.rig, run.delays[name], plan.highest_hz
                )
        except RecordingError as err:
            results[name] = err
            continue
        result = DeviceResult(
            name, rig.axes[name].kind, fit, plan, run.seconds, [], out, run.interrupted
        )
        result = result._replace(notes=[*run.notes, *result.implausible, *_doubts(fit, plan)])
        text = json.dumps(result.as_dict(), indent=2, ensure_ascii=False)
        file = "identification.json" if len(plans) == 1 else f"identification-{name}.json"
        write_text(out / file, text + "\n")
        results[name] = result
    return results


class ExcitedRun(NamedTuple):
    """A recorded excitation: the rig as it ran, and how it went."""

    rig: Rig
    delay: CommandDelay
    seconds: float
    notes: list[str]
    interrupted: bool
    heard: Any
    delays: Mapping[str, CommandDelay] = {}


def record_excitation(
    rig: Rig,
    name: str,
    movers: Mapping[str, Mover],
    *,
    out: Path,
    clock: str,
    duration_s: float,
    allow_uncertified: bool,
    simulate: Simulate,
    attach: bool,
    progress: Callable[[float, str], None] | None,
    allow_unwatched: bool = False,
) -> ExcitedRun:
    """Run a rig without its coupling, moved as given, and record it; see `identify_device`.

    Raises
    ------
    TautwaveError
        The rig is refused, or the run ended in a fault or a stop.
    """
    require_drivers(rig)
    ways = bus_ways(rig, clock=clock, simulate=simulate, attach=attach)
    whole, rig = rig, as_taken(rig, ways)
    problems = over_budget(rig, bus_budgets(rig))
    if problems:
        raise BusBudgetError("\n".join(problems))
    for bus_name, bus in rig.buses.items():
        if bus.divisor > 1:
            raise ConfigError(
                f"buses.{bus_name}.divisor: identify serves every bus in every cycle; run it with "
                f"--set buses.{bus_name}.divisor=1 --set rate_hz={rig.rate_hz / bus.divisor:g}"
            )
    hardware = any(
        load_driver(bus.driver).hardware
        and (rig.simulation is None or ways[bus_name].way is Way.HARDWARE)
        for bus_name, bus in rig.buses.items()
    )
    if hardware and not allow_uncertified:
        refuse_uncertified(rig, certificate_of(whole, ways))
    off = "coupling" if rig.scene is None else "scene"
    notes = [f"The {off} was off; the other axes were enabled without effort."]
    if rig.simulation is not None:
        free = rig.simulation.model_copy(update={"hand": {}, "environment": {}})
        rig = rig.model_copy(update={"simulation": free})
        if not attach:
            notes.append("The simulated hand and environment were removed.")
    if attach:
        notes.append("Doubtful: devices served by another process keep their hand and environment.")
    with devices(rig, ways) as ways:
        assembly = excite(
            rig,
            build_rig(
                rig, clock=clock, duration_s=duration_s, ways=ways, allow_unwatched=allow_unwatched
            ),
            movers,
        )
        delays = {key: bus.driver.command_delay for bus in assembly.buses for key in bus.axes}
        text = resolved_yaml(rig)
        make_directory(out)
        write_text(out / "rig.yaml", text)
        recorder = Recorder(
            out / "recording.mcap",
            assembly.columns,
            metadata=metadata_of(rig, clock, assembly.columns, identifies=name),
            attachments={"rig.yaml": text.encode()},
            rows=rig.loop.ring_rows,
            lossless=clock == "fake",
            rate_hz=rig.rate_hz,
        )  # fmt: skip
        loop = Loop(
            assembly.clock, assembly.buses, assembly.control, assembly.sources,
            recorder, progress, begun=recorder.begin,
        )  # fmt: skip
        with interrupts() as heard, heard.calling(loop.stop):
            recorder.start()
            with loop_conditions(rig, clock), quiet_collector():
                result = loop.run()
            for simulator in assembly.simulators:
                simulator.close()
            stats = recorder.close()
    refuse_enabled(assembly.buses, result.error)
    if isinstance(result.error, KeyboardInterrupt) and not result.opened:
        raise Interrupted(heard.number)
    if result.error is not None and not isinstance(result.error, KeyboardInterrupt):
        _tell(name, result.error, stats.error)
    if stats.error:
        raise WritingError(stats.error)
    seconds = (result.cycles + result.missed_cycles) * rig.period_s
    delay = delays[name.partition(AND)[0]]
    return ExcitedRun(rig, delay, seconds, notes, result.interrupted, heard, delays)


def _tell(name: str, error: BaseException, lost: str | None) -> None:
    """Raise the error that ended the run, with a remedy; `lost` is what its recording lacks."""
    more = f"; {lost}" if lost else ""
    if isinstance(error, SafetyStop):
        raise SafetyStop(
            f"{error}; all axes stopped safely. To identify {name}, make sure that nothing holds "
            "or loads it, start it in the middle of its range, or give a smaller --reach or "
            f"--share{more}"
        ) from error
    if isinstance(error, TautwaveError):
        raise type(error)(f"{error}{more}") from error
    raise TautwaveError(
        f"{type(error).__name__}: {error}; all axes stopped safely{more}"
    ) from error


def fit_recorded(
    path: Path, name: str, rig: Rig, delay: CommandDelay, highest_hz: float
) -> DeviceFit:
    """Fit the device of one axis to the recording of its excitation."""
    from tautwave.analysis.identification.device_model import fit_device

    seen = axis_slots(path, name, rig)
    try:
        return fit_device(
            seen.position,
            seen.effort,
            rig.period_s,
            cutoff_hz=2.0 * highest_hz,
            delay=delay.periods + delay.remainder_s / rig.period_s,
            known=seen.known,
        )
    except ValueError as err:
        raise RecordingError(
            f"{path}: {name} was excited with up to {np.max(np.abs(seen.effort)):.3g} "
            f"{'N m' if rig.axes[name].kind == 'rotary' else 'N'} and cannot be identified: "
            f"{err}; free it, or raise --share"
        ) from err


def _doubts(fit: DeviceFit, plan: Plan) -> list[str]:
    """Warnings about the numbers."""
    notes = []
    if fit.explained < 0.9:
        notes.append(
            f"Doubtful: inertia and friction explain only {fit.explained:.0%} of the effort's "
            "variance; something else (a spring, a cable, a hand) acts on the axis."
        )
    if fit.inertia.lower <= 0.0:
        notes.append(
            "Doubtful: the inertia is indistinguishable from zero; excite it longer or harder."
        )
    if fit.damping.lower <= 0.0:
        notes.append(
            "The damping is not distinguishable from zero, so its lower bound is 0: the "
            "certificate does not rely on it."
        )
    if fit.damping.upper < 0.0:
        notes.append(
            "Doubtful: negative damping; commands act later than the "
            "command_delay that the driver declares."
        )
    return notes
