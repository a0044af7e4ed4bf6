"""What each bus of a rig connects to: hardware, simulated here, or simulated elsewhere."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from enum import Enum
from typing import Any, NamedTuple

from tautwave.clock import FakeClock
from tautwave.config import Rig, bus_spec
from tautwave.contracts import BusSpec, Driver, DriverPlugin, Endpoint
from tautwave.errors import ConfigError
from tautwave.registry import load_driver, load_simulator
from tautwave.types import CommandDelay

NO_OPTIONS: Mapping[str, Any] = {}
Simulate = bool | Collection[str]
"""Buses to simulate although they name hardware; True: all of them."""


class Way(Enum):
    """What a bus connects to, and where simulated devices of this run are."""

    HARDWARE = "hardware"
    MEMORY = "simulated here, in memory"
    SERVED = "simulated here, served by this run"
    ELSEWHERE = "simulated elsewhere"


class BusWay(NamedTuple):
    """The way of one bus.

    `named` is the endpoint in the rig file; `endpoint` what is opened, "" if nothing is or it is
    not yet known; `options` override those of the bus; `server` is the process that serves it
    elsewhere, 0 if unknown.
    """

    way: Way
    named: Endpoint
    endpoint: str = ""
    options: Mapping[str, Any] = NO_OPTIONS
    server: int = 0

    @property
    def forced(self) -> bool:
        """Whether devices are simulated although the rig names hardware."""
        return self.way is not Way.HARDWARE and self.named.kind == "real"

    def describe(self) -> str:
        """Return the way as text, for people."""
        if self.way is Way.HARDWARE:
            return f"hardware at {self.endpoint or 'the endpoint in its options'}"
        text = str(self.way.value)
        if self.endpoint:
            text += f", at {self.endpoint}" if self.way is Way.ELSEWHERE else f" at {self.endpoint}"
        elif self.way is Way.SERVED:
            text += " on a separate endpoint"
        if self.server:
            text += f" (process {self.server})"
        if self.forced:
            text += f"; {self.named.name or 'the hardware'} is not opened"
        return text

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data for JSON; `endpoint` is None where nothing is opened."""
        way, _, where = str(self.way.value).partition(", ")
        return {
            "way": way,
            "where": where or None,
            "endpoint": self.endpoint or None,
            "named": self.named.name or None,
            "forced": self.forced,
            "words": self.describe(),
        }


def choose_way(
    named: Endpoint,
    *,
    fake: bool,
    simulation: bool,
    simulate: bool = False,
    attach: bool = False,
    serves: bool = False,
) -> Way | None:
    """Return the way of a bus, None if nothing would respond.

    Parameters
    ----------
    named : Endpoint
        Endpoint in the driver's options.
    fake : bool
        A fake clock runs, which no endpoint can follow.
    simulation : bool
        The rig has a simulation block.
    simulate, attach : bool
        Command-line options: simulate this bus; use devices that are already served.
    serves : bool
        Its simulator has an endpoint for these options.
    """
    if not simulation:
        if named.kind == "none" or (fake and named.kind == "real"):
            return None
        return Way.HARDWARE if named.kind == "real" else Way.ELSEWHERE
    if fake:
        return Way.MEMORY
    if named.kind == "real" and not simulate:
        return Way.HARDWARE
    if not serves:
        return Way.MEMORY
    return Way.ELSEWHERE if attach else Way.SERVED


def bus_ways(
    rig: Rig, *, clock: str = "real", simulate: Simulate = (), attach: bool = False
) -> dict[str, BusWay]:
    """Return the way of every bus of a rig; touches nothing.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    clock : str
        `real`, or `fake`, on which everything is simulated in memory.
    simulate : bool or collection of str
        Buses to simulate although they name hardware; True: all.
    attach : bool
        Simulated devices are already served, and not by this run.

    Raises
    ------
    ConfigError
        Nothing would respond on a bus, there is no such bus, nothing to
        attach to, or two buses would drive the same devices.
    """
    fake = clock == "fake"
    _refuse_nonsense(rig, fake, simulate, attach)
    ways = {}
    problems = []
    for name in rig.own_buses:
        asked = simulate if isinstance(simulate, bool) else name in simulate
        chosen = _way_of(rig, name, fake, asked, attach)
        if chosen is None:
            problems.append(_nothing_answers(rig, name, fake))
        else:
            ways[name] = chosen
    problems += _driven_twice(rig, ways)
    if problems:
        raise ConfigError(problems)
    if attach and not any(chosen.way is Way.ELSEWHERE for chosen in ways.values()):
        found_ways = "; ".join(f"bus {name}: {chosen.describe()}" for name, chosen in ways.items())
        raise ConfigError(
            f"{rig.name}: --attach: no bus has devices that are served elsewhere ({found_ways})"
            + ("; give --simulate too" if _names_hardware(ways) else "")
        )
    return ways


def _driven_twice(rig: Rig, ways: Mapping[str, BusWay]) -> list[str]:
    """Say which hardware two buses would drive at once: devices of one number at one endpoint."""
    driven: dict[tuple[str, str, int], str] = {}
    problems = []
    for name, way in ways.items():
        if way.way is not Way.HARDWARE or not way.endpoint:
            continue
        driver = rig.buses[name].driver
        places = [(driver, way.endpoint, one.id) for one in rig.axes.values() if one.bus == name]
        twice = [place for place in places if driven.get(place, name) != name]
        if twice:
            problems.append(
                f"bus {name}: it is at {way.endpoint}, as bus {driven[twice[0]]} is, and both have "
                f"a device {twice[0][2]}, which would be driven twice; give each its own"
            )
        driven.update(dict.fromkeys(places, name))
    return problems


def _refuse_nonsense(rig: Rig, fake: bool, simulate: Simulate, attach: bool) -> None:
    if fake and attach:
        raise ConfigError(
            f"{rig.name}: --attach requires the real clock; the fake clock simulates in memory"
        )
    if not isinstance(simulate, bool):
        for name in simulate:
            if name not in rig.own_buses:
                raise ConfigError(
                    f"{rig.name}: --simulate {name}: there is no such bus; the rig has "
                    f"{', '.join(rig.own_buses)}"
                )
    if simulate and rig.simulation is None:
        raise ConfigError(
            f"{rig.name}: --simulate: there is nothing to simulate; add a simulation block to the "
            "rig file"
        )


def _way_of(rig: Rig, name: str, fake: bool, simulate: bool, attach: bool) -> BusWay | None:
    bus = rig.buses[name]
    named = endpoint_of(load_driver(bus.driver), bus.options)
    forced = named.kind == "real" and simulate and not fake
    options: Mapping[str, Any] = NO_OPTIONS
    serves = False
    if rig.simulation is not None and not fake and (named.kind != "real" or forced):
        simulator = load_simulator(bus.driver)
        if forced:
            options = simulator.instead(simulator.options.model_validate(bus.options))
        checked = simulator.options.model_validate({**bus.options, **options})
        serves = simulator.serve is not None and simulator.served(checked)
    way = choose_way(
        named,
        fake=fake,
        simulation=rig.simulation is not None,
        simulate=simulate,
        attach=attach,
        serves=serves,
    )
    if way is None:
        return None
    opened = way is not Way.MEMORY and not forced
    return BusWay(way, named, named.name if opened else "", options)


def endpoint_of(plugin: DriverPlugin, options: Mapping[str, Any]) -> Endpoint:
    """Return the endpoint in the options of a bus, according to its driver."""
    if plugin.endpoint is None:
        return Endpoint("real" if plugin.hardware else "virtual")
    return plugin.endpoint(plugin.options.model_validate(options))


def _names_hardware(ways: Mapping[str, BusWay]) -> bool:
    return any(bus_way.way is Way.HARDWARE for bus_way in ways.values())


def _nothing_answers(rig: Rig, name: str, fake: bool) -> str:
    bus = rig.buses[name]
    endpoint = endpoint_of(load_driver(bus.driver), bus.options)
    if fake and endpoint.kind == "real":
        return (
            f"bus {name}: the fake clock cannot pace {endpoint.name or 'hardware'}; add a "
            "simulation block to the rig, or run on the real clock"
        )
    driver = bus.driver
    if driver == "loopback":
        return f"bus {name}: it has no devices that respond; add a simulation block to the rig"
    return (
        f"bus {name}: it has no endpoint, and the rig has no simulation; add a simulation block "
        "to the rig, or name a device in its options"
    )


def overlaid(rig: Rig, ways: Mapping[str, BusWay]) -> Rig:
    """Return the rig with the bus options overridden by its ways."""
    buses = {
        name: bus.model_copy(update={"options": {**bus.options, **ways[name].options}})
        if name in ways and ways[name].options
        else bus
        for name, bus in rig.buses.items()
    }
    return rig.model_copy(update={"buses": buses})


def as_taken(rig: Rig, ways: Mapping[str, BusWay]) -> Rig:
    """Return the rig for its ways, without the simulated truth of hardware.

    If every bus is hardware the simulation block is removed; else the hand of a real master, the
    environment of a real slave and the truth of both are.
    """
    return without_truth(rig, real_buses(ways))


def real_buses(ways: Mapping[str, BusWay]) -> list[str]:
    """Return the buses that are hardware."""
    return [name for name, bus_way in ways.items() if bus_way.way is Way.HARDWARE]


def without_truth(rig: Rig, buses: Collection[str]) -> Rig:
    """Return the rig without the simulated truth of what is on some buses, see `as_taken`."""
    if rig.simulation is None:
        return rig
    real = {name for name, axis in rig.axes.items() if axis.bus in buses}
    if not real:
        return rig
    if real == set(rig.own_axes):
        return rig.model_copy(update={"simulation": None})
    old = rig.simulation
    left = old.model_copy(
        update={
            "axes": {name: one for name, one in old.axes.items() if name not in real},
            "hand": {name: one for name, one in old.hand.items() if f"master.{name}" not in real},
            "environment": {
                name: one for name, one in old.environment.items() if f"slave.{name}" not in real
            },
        }
    )
    return rig.model_copy(update={"simulation": left})


LATEST = 20
"""Periods until a command acts, at most: what was decided before it has to be kept and summed."""


def command_delays(rig: Rig) -> dict[str, CommandDelay]:
    """Return the command delay that each axis' driver declares.

    Raises
    ------
    ConfigError
        One is longer than `LATEST` periods of its axis.
    """
    delays = {}
    for bus_name, spec, driver in _unopened(rig):
        if driver.command_delay.periods > LATEST:
            raise ConfigError(
                f"bus {bus_name}: its commands act {driver.command_delay.periods} periods late, "
                f"and more than {LATEST} are not coupled; check its options (command_delay_s?), "
                "or lower rate_hz"
            )
        delays.update({axis.name: driver.command_delay for axis in spec.axes})
    return delays


def watchdogs(rig: Rig) -> dict[str, float]:
    """Return the silence of the host after which each axis' device acts by itself [s].

    inf: never. Without those whose devices are in the process of the host, and end with it.
    """
    silences = {}
    for bus_name, spec, driver in _unopened(rig):
        if load_driver(rig.buses[bus_name].driver).hardware:
            known = driver.watchdog_s
            silences.update({axis.name: known.get(axis.name, math.inf) for axis in spec.axes})
    return silences


def _unopened(rig: Rig) -> Iterator[tuple[str, BusSpec, Driver]]:
    """Yield each bus' name, the `BusSpec` its driver is made with, and the driver, unopened."""
    clock = FakeClock()
    for bus_name, bus in rig.buses.items():
        plugin: DriverPlugin = load_driver(bus.driver)
        spec = bus_spec(rig, bus_name)
        yield (
            bus_name,
            spec,
            plugin.make(plugin.options.model_validate(bus.options), spec, clock, None),
        )
