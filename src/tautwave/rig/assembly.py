"""Everything that one run of a rig needs, built from the file; no device is touched."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from tautwave.clock import FakeClock, MonotonicClock
from tautwave.config import Rig, bus_spec
from tautwave.contracts import BusSpec, Clock, DriverPlugin, RowSource, Simulator
from tautwave.registry import load_driver, load_simulator
from tautwave.rig.controller import make_loop_pair, make_site
from tautwave.rig.truth import SEED_WORD, axis_model
from tautwave.runtime.books import PairRow
from tautwave.runtime.loop import TIMING_COLUMNS, LoopPair, LoopSettings
from tautwave.runtime.sensing import LoopBus
from tautwave.runtime.site import SiteAxis
from tautwave.streams import OVERRUN, uniform_stream
from tautwave.types import CommandDelay

if TYPE_CHECKING:
    from tautwave.runtime.scene import SceneRun

NOWHERE: Mapping[str, Mapping[str, Any]] = {}


class Assembly(NamedTuple):
    """A rig, built. `columns` are those of a recorded row, in order; `scene` if there is one."""

    clock: Clock
    settings: LoopSettings
    buses: Sequence[LoopBus]
    pairs: Sequence[LoopPair]
    sources: Sequence[RowSource]
    simulators: Sequence[Simulator]
    columns: Sequence[str]
    scene: SceneRun | None = None


def build_rig(
    rig: Rig,
    *,
    clock: str = "real",
    duration_s: float | None = None,
    endpoints: Mapping[str, Mapping[str, Any]] = NOWHERE,
    allow_unwatched: bool = False,
    configure: bool = False,
) -> Assembly:
    """Build everything that one run of a rig needs; touches no device.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    clock : str
        `real` or `fake`.
    duration_s : float, optional
        Length of the run [s]; the rig's own if not given.
    endpoints : mapping
        Per bus, the options that lead to devices served elsewhere; see `served_buses`.
    allow_unwatched, configure : bool
        Handed to the drivers, in `BusSpec`.

    Raises
    ------
    ConfigError
        A driver is not installed, or a recorded reference cannot be read.
    """
    cycles = round((rig.duration_s if duration_s is None else duration_s) * rig.rate_hz)
    cycles = max(cycles, 1)
    the_clock = make_clock(rig, clock)
    elsewhere = served_buses(rig) if clock == "real" else ()
    buses: list[LoopBus] = []
    simulators: list[Simulator] = []
    sites: dict[str, SiteAxis] = {}
    order: list[str] = []
    sources: list[RowSource] = []
    for bus_name, bus in rig.buses.items():
        plugin = load_driver(bus.driver)
        options = plugin.options.model_validate({**bus.options, **endpoints.get(bus_name, {})})
        spec = bus_spec(rig, bus_name)._replace(
            allow_unwatched=allow_unwatched, configure=configure
        )
        transport: Any = None
        if rig.simulation is not None and bus_name not in elsewhere:
            world = _simulate(rig, spec, bus.driver, bus.options, the_clock, cycles)
            simulators.append(world)
            transport = world.transport
            sources.extend(getattr(world, "axes", ()))
        driver = plugin.make(options, spec, the_clock, transport)
        if isinstance(driver, RowSource):
            sources.append(driver)
        names = [axis.name for axis in spec.axes]
        for name in names:
            sites[name] = _site(rig, name, driver.command_delay)
        order.extend(names)
        of_axes = [sites[name] for name in names]
        buses.append(LoopBus(bus_name, driver, of_axes, names, bus.divisor))
    pairs = [make_loop_pair(rig, name, sites, order) for name in rig.coupling.pairs]
    rows: list[RowSource] = [PairRow(at.pair) for at in pairs]
    scene = None
    if rig.scene is not None:
        from tautwave.rig.scene import build_scene

        build = build_scene
        if rig.scene.dimension == 3:
            from tautwave.rig.space import build_space as build

        built = build(rig, sites, order, cycles)
        scene = built.run
        pairs.extend(built.pairs)
        rows.append(built.row)
    rows.extend(sources)
    columns = [*TIMING_COLUMNS, *(name for source in rows for name in source.columns)]
    settings = loop_settings(rig, cycles)
    return Assembly(the_clock, settings, buses, pairs, rows, simulators, columns, scene)


def _site(rig: Rig, axis_name: str, delay: CommandDelay) -> SiteAxis:
    """Return one axis of the controller; a rig without a scene loads nothing of scenes."""
    if rig.scene is None:
        return make_site(rig, axis_name, delay)
    from tautwave.rig.scene import scene_site

    return scene_site(rig, axis_name, delay)


def _simulate(
    rig: Rig, spec: BusSpec, driver: str, options: Mapping[str, Any], clock: Clock, cycles: int
) -> Simulator:
    simulator = load_simulator(driver)
    models = [axis_model(rig, axis.name, cycles) for axis in spec.axes]
    return simulator.make(simulator.options.model_validate(options), spec, models, clock)


def served_buses(rig: Rig) -> tuple[str, ...]:
    """Return the buses whose simulated devices live in a process of their own on the real clock."""
    if rig.simulation is None:
        return ()
    served = []
    for name, bus in rig.buses.items():
        simulator = load_simulator(bus.driver)
        if simulator.served(simulator.options.model_validate(bus.options)):
            served.append(name)
    return tuple(served)


def command_delays(rig: Rig) -> dict[str, CommandDelay]:
    """Return the command delay that each axis' driver declares."""
    clock = FakeClock()
    delays = {}
    for bus_name, bus in rig.buses.items():
        plugin: DriverPlugin = load_driver(bus.driver)
        spec = bus_spec(rig, bus_name)
        driver = plugin.make(plugin.options.model_validate(bus.options), spec, clock, None)
        delays.update({axis.name: driver.command_delay for axis in spec.axes})
    return delays


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
    ramps = rig.coupling if rig.scene is None else rig.scene
    return LoopSettings(
        period_ns=rig.period_ns,
        cycles=cycles,
        engage_cycles=round(ramps.engage_ramp_s * rate),
        release_cycles=round(ramps.release_ramp_s * rate),
        missing_limit=rig.loop.missing_limit,
        overrun_limit=rig.loop.overrun_limit,
    )
