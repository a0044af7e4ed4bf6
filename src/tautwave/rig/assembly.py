"""Build everything that one run of a rig needs; no device is touched."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.clock import FakeClock, MonotonicClock, PacedClock
from tautwave.config import Rig, bus_spec, has_loads
from tautwave.contracts import BusSpec, Clock, RowSource, Simulator
from tautwave.errors import ConfigError
from tautwave.registry import load_driver, load_simulator
from tautwave.rig.calibrated import calibrated
from tautwave.rig.carrying import side_loads
from tautwave.rig.controller import follower_params, make_control
from tautwave.rig.damping import damped
from tautwave.rig.hooks import rig_hooks
from tautwave.rig.led import pointed_hands
from tautwave.rig.truth import axis_model
from tautwave.rig.ways import BusWay, Way, bus_ways
from tautwave.runtime.carrying.driver import CarryingDriver
from tautwave.runtime.carrying.side import SideLoad
from tautwave.runtime.control import Control
from tautwave.runtime.following import FollowingDriver
from tautwave.runtime.loop import TIMING_COLUMNS
from tautwave.runtime.sensing import LoopBus
from tautwave.streams import OVERRUN, SEED_WORD, uniform_stream
from tautwave.traffic import tapped
from tautwave.truth import AxisModel
from tautwave.types import CommandDelay

LOOPBACK = "loopback"
STOPPING = ("watchdog_s", "unwatched", "unconfirmed")
"""What a driver says of its devices for when the host stops."""

DeviceMaker = Callable[[BusSpec, Sequence[AxisModel], int], Simulator]
"""Makes the simulated devices of a bus for a number of cycles."""


class Assembly(NamedTuple):
    """A built rig. `columns` are those of a recorded row, in order."""

    clock: Clock
    buses: Sequence[LoopBus]
    control: Control
    sources: Sequence[RowSource]
    simulators: Sequence[Simulator]
    columns: Sequence[str]

    @property
    def delays(self) -> dict[str, CommandDelay]:
        """Command delays of the drivers, by full name of an axis."""
        return {name: bus.driver.command_delay for bus in self.buses for name in bus.axes}


def build_rig(
    rig: Rig,
    *,
    clock: str = "real",
    duration_s: float | None = None,
    ways: Mapping[str, BusWay] | None = None,
    allow_unwatched: bool = False,
    configure: bool = False,
    devices: DeviceMaker | None = None,
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
    ways : mapping, optional
        How each bus is run, with its options; `bus_ways` if not given.
    allow_unwatched, configure : bool
        Handed to the drivers, in `BusSpec`.

    devices : callable, optional
        Makes the simulated devices of loopback buses, instead of their simulator.

    Raises
    ------
    ConfigError
        A driver is not installed, a recorded reference cannot be read, nothing would respond on a
        bus, or the length is none.
    """
    cycles = cycles_in(rig, duration_s)
    if ways is None:
        ways = bus_ways(rig, clock=clock)
    the_clock = make_clock(rig, clock)
    if (
        clock == "real"
        and pointed_hands(rig)
        and all(one.way is Way.MEMORY for one in ways.values())
    ):
        the_clock = PacedClock()
    buses: list[LoopBus] = []
    simulators: list[Simulator] = []
    delays: dict[str, CommandDelay] = {}
    sources: list[RowSource] = []
    for bus_name, bus in rig.own_buses.items():
        plugin = load_driver(bus.driver)
        options = {**bus.options, **ways[bus_name].options}
        spec = bus_spec(rig, bus_name)._replace(
            allow_unwatched=allow_unwatched, configure=configure
        )
        transport: Any = None
        if ways[bus_name].way is Way.MEMORY:
            if devices is not None and bus.driver == LOOPBACK:
                models = [axis_model(rig, axis.name, cycles) for axis in spec.axes]
                world = devices(spec, models, cycles)
            else:
                world = _simulate(rig, spec, bus.driver, options, the_clock, cycles)
            simulators.append(world)
            transport = tapped(bus_name, world.transport, the_clock)
            sources.extend([world] if isinstance(world, RowSource) else getattr(world, "axes", ()))
            sources.extend(getattr(world, "arms", ()))
        driver = plugin.make(plugin.options.model_validate(options), spec, the_clock, transport)
        lacking = [name for name in STOPPING if not hasattr(driver, name)]
        if lacking:
            raise ConfigError(
                f"bus {bus_name}: its driver {bus.driver} does not say {', '.join(lacking)}, so it "
                "is not known what its devices do when this program stops; update the package "
                "that provides the driver"
            )
        if isinstance(driver, RowSource) and driver.columns:
            sources.append(driver)
        names = [axis.name for axis in spec.axes]
        delays.update(dict.fromkeys(names, driver.command_delay))
        one = calibrated(rig, LoopBus(bus_name, driver, names, bus.divisor))
        if any(axis.takes_position for axis in spec.axes):
            following = FollowingDriver(
                one.driver,
                names,
                [follower_params(rig, name, driver.command_delay) for name in names],
            )
            sources.append(following)
            one = one._replace(driver=following)
        buses.append(one)
    if has_loads(rig):
        loads, buses = carry_loads(rig, buses)
        sources.extend(loads)
    control: Control
    if rig.scene is None:
        control = make_control(rig, delays, cycles)
    else:
        control = rig_hooks().build(rig, delays, cycles)
    buses = damped(rig, buses, control)
    rows: list[RowSource] = [control, *sources]
    columns = [*TIMING_COLUMNS, *(name for source in rows for name in source.columns)]
    return Assembly(the_clock, buses, control, rows, simulators, columns)


def carry_loads(rig: Rig, buses: Sequence[LoopBus]) -> tuple[Sequence[SideLoad], list[LoopBus]]:
    """Return what carries the loads of a rig, and its buses with drivers that do."""
    delays = {name: bus.driver.command_delay for bus in buses for name in bus.axes}
    loads, seats = side_loads(rig, delays)
    carrying = []
    for bus in buses:
        own = [seats.get(name) for name in bus.axes]
        if any(own):
            period_ns = rig.period_ns * bus.divisor
            bus = bus._replace(driver=CarryingDriver(bus.driver, own, period_ns))
        carrying.append(bus)
    return loads, carrying


def cycles_in(rig: Rig, duration_s: float | None = None) -> int:
    """Return the cycles of a length [s], of the rig's own by default; at least one.

    Raises
    ------
    ConfigError
        It is not finite, or not greater than 0.
    """
    if duration_s is None:
        return max(rig.cycles, 1)
    if not 0.0 < duration_s < math.inf:
        raise ConfigError(f"duration_s: a finite number of seconds greater than 0 ({duration_s!r})")
    return max(round(duration_s * rig.rate_hz), 1)


def _simulate(
    rig: Rig, spec: BusSpec, driver: str, options: Mapping[str, Any], clock: Clock, cycles: int
) -> Simulator:
    simulator = load_simulator(driver)
    models = [axis_model(rig, axis.name, cycles) for axis in spec.axes]
    return simulator.make(simulator.options.model_validate(options), spec, models, clock)


def make_clock(rig: Rig, clock: str) -> Clock:
    """Return the clock of a run, `real` or `fake`; this one oversleeps by the rig's seeded faults.

    Raises
    ------
    ConfigError
        It is neither.
    """
    if clock == "real":
        return MonotonicClock()
    if clock != "fake":
        raise ConfigError(f"clock: real or fake (got {clock!r})")
    faults = None if rig.simulation is None else rig.simulation.faults
    if faults is None or faults.overrun_probability == 0.0:
        return FakeClock()
    stream = uniform_stream((rig.seed % SEED_WORD, OVERRUN))
    probability = faults.overrun_probability
    late_ns = faults.overrun_slots * rig.period_ns
    return FakeClock(oversleep=lambda _: late_ns if next(stream) < probability else 0)
